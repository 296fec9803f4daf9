"""What the feedback stages of the scraping testbed wrote, and what follows from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.folds import PARTS
from structlearn.feedback.model_comparison import REPRESENTATIONS, STOPPINGS
from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.feedback.supervision import Cuts
from structlearn.ground import signals
from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import UNDECIDED
from structlearn.primitives import sensor_traces
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.execution_cuts import commanded_cuts
from structlearn.tactile.electrodes import ELECTRODES_MM
from structlearn.testbeds.scraping.page import board_results, refinement_results
from structlearn.testbeds.scraping.page.board_results import BoardResults
from structlearn.testbeds.scraping.page.execution_results import weakest
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.protocol.execution_scores import execution_scores
from structlearn.testbeds.scraping.protocol.orientation_cost import nominal_orientation
from structlearn.testbeds.scraping.world.recorder import FINGERS

PUBLISHED_NMSE: Mapping[int, Mapping[str, tuple[float, float]]] = {
    2: {
        "train": (0.15, 0.05),
        "validation": (0.15, 0.05),
        "test": (0.16, 0.06),
        "generalization": (0.36, 0.19),
    },
    3: {
        "train": (0.22, 0.05),
        "validation": (0.22, 0.05),
        "test": (0.22, 0.05),
        "generalization": (0.32, 0.13),
    },
}
"""Mean and std of table IV.5 by the primitive's number."""

PUBLISHED_DIMENSIONS = {2: 7, 3: 6}
"""Principal components that hold 99 % of the variance (IV.9.3.3), by the primitive's number."""

MODEL_CLAIMS = {
    "PMNN with one hidden layer of 100 nodes is the best of the network structures": (
        "Fig. IV.16 top",
        (("pmnn_100", "pmnn_0"), ("pmnn_100", "ffnn_phase"), ("pmnn_100", "ffnn")),
    ),
    "Order: PMNN-100, PMNN without hidden layer, FFNN with phase, FFNN": (
        "Fig. IV.16 top",
        (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    ),
    "FFNN that is told the phase is better than without": ("IV.9.3.2", (("ffnn_phase", "ffnn"),)),
    "Features learned inside the PMNN (100 and 6 nodes) are better than learned apart from it (PCA, "
    "autoencoder)": (
        "Fig. IV.16 middle",
        (
            ("pmnn_100", "pca"),
            ("pmnn_100", "autoencoder"),
            ("pmnn_6", "pca"),
            ("pmnn_6", "autoencoder"),
        ),
    ),
    "Of the two PMNNs the one with 100 nodes is better than the one with 6": (
        "IV.9.3.3",
        (("pmnn_100", "pmnn_6"),),
    ),
}
"""Statement, its source and the pairs (better, worse) that it is made of."""


SAMPLES = 101
"""Points over normalised time on which curves are compared."""


@dataclass(frozen=True)
class FeedbackResults:
    """What the feedback stages wrote.

    Attributes:
        primitives: names of all primitives in order of time.
        unrolls: nominal executions in the default setting.
        unroll_cuts: of these.
        expected: expected traces by primitive.
        datasets: by primitive, of all settings; empty where nothing was corrected.
        checks: of `supervision.coupling_dataset`, by primitive.
        networks: the pointwise models by primitive.
        comparison: of `comparison.compare_representations`, with `primitive`; empty where not made.
        orderings: of `comparison.paired_orderings`, with `primitive`.
        seen_deg: settings that are learned from.
        board: what was executed with the models; None where there is no simulation.
        refinement: what came of refining the models by trial; None where nothing was refined.
    """

    primitives: Sequence[str]
    unrolls: Sequence[Demonstration]
    unroll_cuts: Cuts
    expected: Mapping[str, VectorPrimitive]
    datasets: Mapping[str, CouplingDataset]
    checks: Mapping[str, pd.DataFrame]
    networks: Mapping[str, PhaseModulatedNetwork]
    comparison: pd.DataFrame
    orderings: pd.DataFrame
    seen_deg: Sequence[float]
    board: BoardResults | None
    refinement: RefinementResults | None

    @cached_property
    def simulated(self) -> bool:
        """Whether the executions were simulated."""
        return any(run.simulated for run in self.unrolls)

    @cached_property
    def adapted(self) -> list[str]:
        """Primitives with feedback, in order of time."""
        return [name for name in self.primitives if name in self.datasets]

    def number(self, primitive: str) -> int:
        """Place of a primitive in the sequence, from 1, as the dissertation counts."""
        return list(self.primitives).index(primitive) + 1

    @cached_property
    def settings_deg(self) -> list[float]:
        """Settings with corrections, rising."""
        return sorted({float(value) for one in self.datasets.values() for value in np.unique(one.setting)})

    @cached_property
    def demonstrations_per_setting(self) -> int:
        """Corrected demonstrations in a setting, at most."""
        return max(len(np.unique(one.demonstration)) for one in self.datasets.values())

    @cached_property
    def channels(self) -> dict[str, tuple[int, float]]:
        """By primitive, the channel of `informative_channel` and its correlation with the tilt."""
        return {name: informative_channel(self.datasets[name]) for name in self.adapted}

    def channel_name(self, channel: int) -> str:
        """`channel 25`, and in the simulation whose electrode it is."""
        name = f"channel {channel + 1}"
        if self.simulated:
            finger, electrode = divmod(channel, len(ELECTRODES_MM))
            name += f" ({FINGERS[finger]} finger, electrode {electrode + 1})"
        return name

    @cached_property
    def expected_errors(self) -> tuple[float, float]:
        """Counts, rms over everything: the expected trace off the mean run, and the std of the runs."""
        off, spread = [], []
        for name in self.primitives:
            runs, learned = unroll_traces(self, name)
            off.append(np.mean((runs.mean(axis=0) - learned) ** 2))
            spread.append(np.mean(runs.var(axis=0, ddof=1)) if len(runs) > 1 else np.nan)
        return float(np.sqrt(np.mean(off))), float(np.sqrt(np.mean(spread)))

    @cached_property
    def folds(self) -> int:
        """Folds of the comparison."""
        return self.comparison["fold"].nunique()

    @cached_property
    def model_errors(self) -> pd.DataFrame:
        """Mean and std over the folds of the NMSE.

        One row per primitive, representation and stopping: `<part>_mean` and `<part>_std` of every part, and
        `dimensions`, mean size of the code.
        """
        rows = []
        grouped = self.comparison.groupby(["primitive", "representation", "stopping"])
        for name in self.adapted:
            for representation in REPRESENTATIONS:
                for stopping in STOPPINGS:
                    if (name, representation, stopping) in grouped.groups:
                        group = grouped.get_group((name, representation, stopping))
                        row = {"primitive": name, "representation": representation, "stopping": stopping}
                        for part in PARTS:
                            row |= {f"{part}_mean": group[part].mean(), f"{part}_std": group[part].std()}
                        rows.append(row | {"dimensions": group["dimensions"].mean()})
        return pd.DataFrame(rows)

    def model_error(self, primitive: str, representation: str, stopping: str = "validation") -> pd.Series:
        """A row of `model_errors`."""
        table = self.model_errors.set_index(["primitive", "representation", "stopping"])
        return table.loc[(primitive, representation, stopping)]

    @cached_property
    def demonstrated_costs(self) -> pd.DataFrame:
        """Scores of the corrected demonstrations that `board` holds, as `evaluation.execution_scores`."""
        board = self.board
        cuts = commanded_cuts(board.corrected, self.primitives)
        scored = {name: cuts[name] for name in board.primitives}
        return execution_scores(board.corrected, scored, nominal_orientation(self.unrolls), board.axis)

    def claim_verdicts(self, pairs: Sequence[tuple[str, str]]) -> dict[str, str]:
        """By primitive: better if every pair is as claimed, worse if one is the other way round."""
        found = self.orderings[self.orderings["stopping"] == "validation"]
        found = found.set_index(["primitive", "better", "worse"])["verdict"]
        verdicts = {}
        for name in self.adapted:
            verdicts[name] = weakest(found.get((name, *pair), UNDECIDED) for pair in pairs)
        return verdicts


def informative_channel(dataset: CouplingDataset) -> tuple[int, float]:
    """The channel whose mean deviation in a demonstration correlates most with the setting, and how much."""
    keys = pd.MultiIndex.from_arrays([dataset.setting, dataset.demonstration])
    means = pd.DataFrame(dataset.deviation, index=keys).groupby(level=(0, 1)).mean()
    setting = means.index.get_level_values(0).to_numpy(float)
    setting = setting - setting.mean()
    values = means.to_numpy() - means.to_numpy().mean(axis=0)
    scale = np.sqrt((setting**2).sum() * (values**2).sum(axis=0))
    correlation = setting @ values / np.where(scale > 0.0, scale, np.inf)
    channel = int(np.argmax(np.abs(correlation)))
    return channel, float(correlation[channel])


def unroll_traces(results: FeedbackResults, primitive: str) -> tuple[np.ndarray, np.ndarray]:
    """Traces of one primitive in the executions, and what was learned from them, over normalised time.

    Returns:
        (R, T, E) counts of the runs and (T, E) of the expected trace.
    """
    runs = []
    for run in results.unrolls:
        first, last = (
            round(float(results.unroll_cuts[primitive].loc[run.name, end]) / run.dt)
            for end in ("start_s", "end_s")
        )
        part = sensor_traces.without_offset(run.tactile)[first : last + 1]
        runs.append(signals.time_normalised(part, SAMPLES))
    learned = results.expected[primitive]
    return np.stack(runs), sensor_traces.expected(learned, SAMPLES, learned.duration / (SAMPLES - 1))


def tables(results: FeedbackResults) -> dict[str, pd.DataFrame]:
    """Tables of the feedback sections by name."""
    found: dict[str, pd.DataFrame] = {}
    if results.datasets:
        found["coupling_checks"] = pd.concat(
            [results.checks[name].assign(primitive=name) for name in results.adapted], ignore_index=True
        )
    if len(results.comparison):
        found["model_errors"] = results.model_errors
        found["model_orderings"] = results.orderings
    if results.board is not None:
        found |= board_results.tables(results.board, results.seen_deg)
    if results.refinement is not None:
        found |= refinement_results.tables(results.refinement)
    return found


def metrics(results: FeedbackResults) -> Metrics:
    """Key figures of feedback.

    `<model>_prim<number>_generalization_nmse` is the mean over folds at the step that validation chose, with
    the suffix `_best_step` at the best step for the demonstration that was left out, as in the dissertation.
    `cost_ratio_<model>_over_nominal_<degrees>` is the accumulated cost of both primitives with feedback
    relative to without, `feedback` being the pointwise model. `force_largest_error_percent` is of the mean
    force of any execution; `roll_torque_monotone` is of executions without feedback. Those of the refinement
    are described in `refinement_results.metrics`.
    """
    values: Metrics = {}
    for name in results.adapted if len(results.comparison) else ():
        for representation, key in (("pmnn_100", "pmnn"), ("ffnn_phase", "ffnn_phase"), ("ffnn", "ffnn")):
            for stopping, suffix in (("validation", ""), ("generalization", "_best_step")):
                error = results.model_error(name, representation, stopping)["generalization_mean"]
                values[f"{key}_prim{results.number(name)}_generalization_nmse{suffix}"] = float(error)
    if results.board is not None:
        values |= board_results.metrics(results.board)
    if results.refinement is not None:
        values |= refinement_results.metrics(results.refinement, results.number)
    return values
