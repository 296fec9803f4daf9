"""A small world of feedback results in memory, for the tests of the report."""

from itertools import product

import numpy as np
import pandas as pd
from conftest import minimum_jerk
from reporting_scraping import DT

from structlearn.core import quaternion
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_targets import learn_expected
from structlearn.feedback.feedback_models import REPRESENTATIONS, STOPPINGS, paired_orderings
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.primitives import canonical
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.studies import OURS, Study
from structlearn.segmentation.segments import commanded_cuts
from structlearn.testbeds.scraping.page.board_results import BoardResults
from structlearn.testbeds.scraping.page.results import FeedbackResults
from structlearn.testbeds.scraping.world.demonstrator import FLAT_ORIENTATION

PRIMITIVES = ("down", "turn", "scrape")
ADAPTED = PRIMITIVES[1:]
SETTINGS = (2.5, 5.0, 10.0)
SEEN = (2.5, 10.0)
AXIS = np.array([0.0, 1.0, 0.0])
SEGMENTS = np.array([[0.0, 1.0], [1.0, 3.0], [3.0, 5.0]])
CHANNELS = 4
TELLING = 2
RUNS = 4
NMSE = {"pmnn_100": 0.2, "pmnn_6": 0.26, "pmnn_0": 0.3, "ffnn_phase": 0.4, "ffnn": 0.5} | {
    "pca": 0.35,
    "autoencoder": 0.36,
}
COST_RAD = {"nominal": 10.0, "pointwise": 4.0, "level": 3.5, "unrolled": 5.0}


def execution(seed: int, setting: float = 0.0, corrected: float = 0.0) -> Demonstration:
    """Five seconds on a board at `setting` degrees; the hand turns by `corrected` degrees in the second."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(round(SEGMENTS[-1, 1] / DT) + 1)
    turned, pressed = minimum_jerk((time - 1.0) / 1.5), minimum_jerk((time - 0.9) / 0.2)
    hand = np.radians(corrected) * np.outer(turned, AXIS)
    gap = hand - np.radians(setting) * AXIS
    tactile = np.outer(pressed, [30.0, -20.0, 10.0, 5.0]) + rng.normal(0.0, 0.3, (len(time), CHANNELS))
    tactile[:, TELLING] += pressed * np.degrees(gap[:, 1])
    return Demonstration(
        name=f"{seed:02d}",
        time=time,
        position=np.zeros((len(time), 3)),
        orientation=quaternion.product(quaternion.from_rotation_vector(hand), FLAT_ORIENTATION),
        wrench=np.outer(pressed, [0.0, 0.0, -1.0, 0.0, -1e-4 * setting, 0.0]),
        tactile=tactile,
        tool_to_board=quaternion.from_rotation_vector(gap),
        true_segments=SEGMENTS,
        provenance={"origin": "simulated"},
    )


def dataset() -> CouplingDataset:
    """Three demonstrations per setting; one channel and the target grow with the setting."""
    rng = np.random.default_rng(0)
    parts = []
    for setting, number in product(SETTINGS, range(3)):
        time = 0.02 * np.arange(60 + number)
        p, u = canonical.phase(time, canonical.time_constant(time[-1]))
        deviation = rng.normal(0.0, 1.0, (len(time), CHANNELS))
        deviation[:, TELLING] -= 4.0 * setting
        target = setting * np.sin(np.pi * time / time[-1]) + 0.1 * number
        keys = np.full(len(time), setting), np.full(len(time), number)
        parts.append((deviation, p, u, target, *keys, time))
    return CouplingDataset(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def checks() -> pd.DataFrame:
    rows = [(setting, number, f"{number}", 0.2, 0.01, 0.1) for setting in SETTINGS for number in range(3)]
    columns = ["setting_deg", "demonstration", "name", "reproduction_deg", "smoothing_deg", "others"]
    return pd.DataFrame(rows, columns=columns)


def phase_weights() -> np.ndarray:
    """(25, 100) weights whose largest move on by four nodes from kernel to kernel."""
    places = (np.arange(100) - 4.0 * np.arange(25)[:, None] + 50.0) % 100.0 - 50.0
    return np.exp(-((places / 10.0) ** 2))


def network(weights: np.ndarray | None = None) -> PhaseModulatedNetwork:
    rng = np.random.default_rng(0)
    return PhaseModulatedNetwork(
        input_mean=np.zeros(CHANNELS),
        input_scale=np.ones(CHANNELS),
        hidden=((rng.normal(size=(100, CHANNELS)), np.zeros(100)),),
        phase_weights=phase_weights() if weights is None else weights,
        phase_biases=np.zeros(25),
        output_weights=np.ones(25),
    )


def comparison(nmse: dict[str, float] = NMSE, folds: int = 8) -> pd.DataFrame:
    """Errors that spread over the folds by a tenth of the smallest difference between representations."""
    rng = np.random.default_rng(1)
    rows = []
    for primitive, name, stopping, fold in product(ADAPTED, REPRESENTATIONS, STOPPINGS, range(folds)):
        error = nmse[name] + 1e-3 * rng.normal() - 0.02 * (stopping == "generalization")
        rows.append((name, fold, stopping, 100, 0.1, 0.11, 0.12, error, 2.0, primitive))
    columns = ["representation", "fold", "stopping", "step", "train", "validation", "test", "generalization"]
    return pd.DataFrame(rows, columns=[*columns, "dimensions", "primitive"])


def orderings(table: pd.DataFrame) -> pd.DataFrame:
    groups = table.groupby("primitive", sort=False)
    return pd.concat([paired_orderings(rows).assign(primitive=name) for name, rows in groups])


def scores(cost_rad: dict[str, float] = COST_RAD, force_n: float = 1.01) -> pd.DataFrame:
    """Cost in proportion to the setting; a fixed one at 0 degrees, where feedback only costs."""
    rng = np.random.default_rng(2)
    rows = []
    for model, setting, run, primitive in product(cost_rad, (0.0, *SETTINGS), range(RUNS), ADAPTED):
        level = 2.0 if model == "nominal" else 8.0
        total = (cost_rad[model] * setting if setting else level) + 0.1 * rng.normal()
        roll = -setting if model == "nominal" else 0.1
        row = (f"{run:02d}", primitive, total, 0.01 * total, roll, force_n, 0.02, 0.3 * setting)
        rows.append((*row, model, setting))
    columns = ["run", "primitive", "cost_rad", "mean_deg", "end_roll_deg", "force_n", "force_std_n"]
    return pd.DataFrame(rows, columns=[*columns, "roll_torque_mn_m", "model", "setting_deg"])


def traces(gain: float = 2.0) -> pd.DataFrame:
    """Coupling terms in proportion to the setting."""
    rng = np.random.default_rng(3)
    tables = []
    for model, primitive, setting, run in product(COST_RAD, ADAPTED, (0.0, *SETTINGS), range(RUNS)):
        coupling = 0.0 if model == "nominal" else gain * setting + 0.1 * rng.normal()
        keys = {"model": model, "primitive": primitive, "setting_deg": setting, "run": f"{run:02d}"}
        keys |= {"time_s": 0.02 * np.arange(50), "coupling": coupling}
        keys |= {f"channel_{index:02d}": rng.normal(size=50) for index in range(CHANNELS)}
        tables.append(pd.DataFrame(keys))
    return pd.concat(tables, ignore_index=True)


def path_errors() -> pd.DataFrame:
    """The model that is trained in the unroll is better."""
    rng = np.random.default_rng(4)
    level = {"pointwise": 0.5, "unrolled": 0.2}
    keys = product(level, ADAPTED, SETTINGS, range(3))
    rows = [(*key, level[key[0]] + 0.01 * rng.normal()) for key in keys]
    columns = ["model", "primitive", "setting_deg", "demonstration", "error_deg"]
    return pd.DataFrame(rows, columns=columns)


def people(metrics: dict[str, float], count: int = 5, spread: float = 0.01, **changes: float) -> Study:
    """A study of people who differ by a little from given numbers; `changes` replace some of these."""
    rng = np.random.default_rng(5)
    numbers = {key: float(value) for key, value in metrics.items()} | changes
    columns = {key: value * (1.0 + spread * rng.normal(size=count)) for key, value in numbers.items()}
    return Study({"findings": pd.DataFrame({"variant": OURS, "cell": range(count)} | columns)})


def board_results() -> BoardResults:
    """Executions in which feedback helps at every tilt and costs something at 0 degrees."""
    return BoardResults(
        scores=scores(),
        traces=traces(),
        path_errors=path_errors(),
        examples={
            "nominal": [execution(seed, 10.0) for seed in range(2)],
            "pointwise": [execution(seed, 10.0, corrected=8.0 + seed) for seed in range(2)],
        },
        corrected=[execution(seed, 10.0, corrected=10.0) for seed in range(2)],
        example_deg=10.0,
        axis=AXIS,
        force_n=1.0,
    )


def feedback_results() -> FeedbackResults:
    """Everything that the feedback stages would have written."""
    unrolls = [execution(seed) for seed in range(3)]
    cuts = commanded_cuts(unrolls, PRIMITIVES)
    table = comparison()
    return FeedbackResults(
        primitives=PRIMITIVES,
        unrolls=unrolls,
        expected=learn_expected(unrolls, cuts, 10.0, ["tactile"]),
        datasets={name: dataset() for name in ADAPTED},
        checks=pd.concat([checks().assign(primitive=name) for name in ADAPTED], ignore_index=True),
        networks={name: network() for name in ADAPTED},
        comparison=table,
        orderings=orderings(table),
        seen_deg=SEEN,
        board=board_results(),
    )
