"""A small world of feedback results in memory, for the tests of the report."""

from itertools import product

import numpy as np
import pandas as pd
from conftest import minimum_jerk
from reporting_scraping import DT, grid

from dissertation.scraping.protocol.feedback_models import REPRESENTATIONS, STOPPINGS, paired_orderings
from dissertation.scraping.world.demonstrator import FLAT_ORIENTATION
from structlearn.core import quaternion
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_targets import learn_expected
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.primitives import canonical
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import commanded_cuts

PRIMITIVES = ("down", "turn", "scrape")
ADAPTED = PRIMITIVES[1:]
SETTINGS = (2.5, 5.0, 10.0)
SEEN = (2.5, 10.0)
AXIS = np.array([0.0, 1.0, 0.0])
SEGMENTS = np.array([[0.0, 1.0], [1.0, 3.0], [3.0, 5.0]])
CHANNELS = 4
TELLING = 2
NAMES = ("00", "01", "02", "03")  # of runs
NMSE = {"pmnn_100": 0.2, "pmnn_6": 0.26, "pmnn_0": 0.3, "ffnn_phase": 0.4, "ffnn": 0.5} | {
    "pca": 0.35,
    "autoencoder": 0.36,
}
HAND_DEG = {
    "nominal": lambda seed: 0.0,
    "pointwise": lambda seed: 8.0 + seed,
    "corrected": lambda seed: 10.0,
}
"""Degrees by which the hand turns at 10 degrees, by kind of execution."""

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
    table = grid(primitive=ADAPTED, setting_deg=SETTINGS, demonstration=range(3))
    numbers = {"reproduction_deg": 0.2, "smoothing_deg": 0.01, "others": 0.1}
    return table.assign(name=table["demonstration"].astype(str), **numbers)


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
    table = grid(primitive=ADAPTED, representation=REPRESENTATIONS, stopping=STOPPINGS, fold=range(folds))
    error = table["representation"].map(nmse) + 1e-3 * np.random.default_rng(1).normal(size=len(table))
    error -= 0.02 * (table["stopping"] == "generalization")
    numbers = {"step": 100, "train": 0.1, "validation": 0.11, "test": 0.12, "dimensions": 2.0}
    return table.assign(generalization=error, **numbers)


def orderings(table: pd.DataFrame) -> pd.DataFrame:
    groups = table.groupby("primitive", sort=False)
    return pd.concat([paired_orderings(rows).assign(primitive=name) for name, rows in groups])


def scores(cost_rad: dict[str, float] = COST_RAD, force_n: float = 1.01) -> pd.DataFrame:
    """Cost in proportion to the setting; a fixed one at 0 degrees, where feedback only costs."""
    table = grid(model=cost_rad, setting_deg=(0.0, *SETTINGS), run=NAMES, primitive=ADAPTED)
    tilt, nominal = table["setting_deg"], table["model"] == "nominal"
    cost = (table["model"].map(cost_rad) * tilt).where(tilt > 0.0, np.where(nominal, 2.0, 8.0))
    cost += 0.1 * np.random.default_rng(2).normal(size=len(table))
    rolls = {"end_roll_deg": (-tilt).where(nominal, 0.1), "roll_torque_mn_m": 0.3 * tilt}
    return table.assign(cost_rad=cost, mean_deg=0.01 * cost, force_n=force_n, force_std_n=0.02, **rolls)


def traces(gain: float = 2.0) -> pd.DataFrame:
    """Coupling terms in proportion to the setting."""
    rng = np.random.default_rng(3)
    tables = []
    for model, primitive, setting, run in product(COST_RAD, ADAPTED, (0.0, *SETTINGS), NAMES):
        coupling = 0.0 if model == "nominal" else gain * setting + 0.1 * rng.normal()
        keys = {"model": model, "primitive": primitive, "setting_deg": setting, "run": run}
        keys |= {"time_s": 0.02 * np.arange(50), "coupling": coupling}
        keys |= {f"channel_{index:02d}": rng.normal(size=50) for index in range(CHANNELS)}
        if model != "nominal":  # as in the demonstrations
            keys[f"channel_{TELLING:02d}"] -= 4.0 * setting
        tables.append(pd.DataFrame(keys))
    return pd.concat(tables, ignore_index=True)


def path_errors() -> pd.DataFrame:
    """The model that is trained in the unroll is better."""
    level = {"pointwise": 0.5, "unrolled": 0.2}
    table = grid(model=level, primitive=ADAPTED, setting_deg=SETTINGS, demonstration=range(3))
    noise = 0.01 * np.random.default_rng(4).normal(size=len(table))
    return table.assign(error_deg=table["model"].map(level) + noise)


def feedback_stages() -> tuple[dict[str, object], dict[str, pd.DataFrame]]:
    """What the feedback stages would have written: fields and tables of `Stored`.

    Feedback helps at every tilt and costs something at 0 degrees.
    """
    unrolls, table = [execution(seed) for seed in range(3)], comparison()
    fields = {
        "unrolls": unrolls,
        "expected": learn_expected(unrolls, commanded_cuts(unrolls, PRIMITIVES), 10.0, ["tactile"]),
        "datasets": {name: dataset() for name in ADAPTED},
        "networks": {name: network() for name in ADAPTED},
        "tilted": {
            kind: [execution(seed, 10.0, corrected=turned(seed)) for seed in range(2)]
            for kind, turned in HAND_DEG.items()
        },
    }
    tables = {"checks": checks(), "comparison": table, "orderings": orderings(table), "scores": scores()}
    return fields, tables | {"traces": traces(), "path_errors": path_errors()}
