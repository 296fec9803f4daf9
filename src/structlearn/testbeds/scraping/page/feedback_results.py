"""Feedback models (IV.6, IV.9.3): what the stages wrote, and the numbers that follow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.metrics import mean_interval, verdict
from structlearn.feedback.coupling_dataset import PARTS, CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.coupling_targets import Cuts
from structlearn.feedback.feedback_models import LEVEL, POINTWISE, REPRESENTATIONS, STOPPINGS, UNROLLED
from structlearn.primitives import vector
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import commanded_cuts
from structlearn.tactile.electrodes import ELECTRODES_MM
from structlearn.testbeds.scraping.page.execution_results import ExecutionResults, welch
from structlearn.testbeds.scraping.protocol.execution_scores import (
    NOMINAL,
    execution_scores,
    nominal_orientation,
)
from structlearn.testbeds.scraping.world.testbed import FINGERS

SAMPLES = 101  # Points over normalised time on which curves are compared
MODEL_KEYS = {NOMINAL: "nominal", POINTWISE: "feedback", LEVEL: "level", UNROLLED: "unrolled"}
"""What executions are called in the keys of numbers."""

REPRESENTATION_KEYS = {name: name for name in REPRESENTATIONS} | {"pmnn_100": "pmnn"}
"""What representations are called in the keys of numbers."""

STEP_KEYS = {"validation": "", "generalization": "_best_step"}
"""Ends of the keys of NMSEs, by the part whose error chose the training step."""


@dataclass(frozen=True)
class BoardResults(ExecutionResults):
    """Executions without feedback and with each model; `example_deg` is the largest setting."""

    traces: pd.DataFrame  # of `execution_scores.traces`
    path_errors: pd.DataFrame  # of `corrected_paths.path_errors`
    corrected: Sequence[Demonstration]  # corrected demonstrations in the setting `example_deg`
    force_n: float  # that the robot was asked to hold

    @cached_property
    def nominal(self) -> pd.DataFrame:
        """Executions without feedback: means over runs per `setting_deg` and `primitive`."""
        rows = self.scores[self.scores["model"] == NOMINAL].drop(columns=["run", "model"])
        return rows.groupby(["setting_deg", "primitive"], sort=True).mean()

    @cached_property
    def force_error_percent(self) -> float:
        """Largest error of the mean force of any execution, with or without feedback."""
        return float(100.0 * (self.scores["force_n"] / self.force_n - 1.0).abs().max())

    @cached_property
    def smallest_steps(self) -> dict[str, tuple[float, float]]:
        """By primitive, smallest step from tilt to tilt of the mean roll torque and the mean coupling term.

        The torque in mN m is without feedback, the coupling term in rad of the pointwise model; positive
        where they change one way with the tilt.
        """
        steps = {}
        for name in self.primitives:
            torque = self.nominal.xs(name, level="primitive")["roll_torque_mn_m"]
            coupling = self.coupling.loc[self.coupling["primitive"] == name, "mean"]
            steps[name] = _smallest_step(torque.to_numpy()), _smallest_step(coupling.to_numpy())
        return steps

    @cached_property
    def felt_counts(self) -> pd.Series:
        """By `setting_deg`, rms over channels and time of the deviation from what was expected, counts.

        Of executions without feedback: on the level board it is how much one contact differs from another.
        """
        nominal = self.traces[self.traces["model"] == NOMINAL]
        squares = nominal.filter(like="channel_").pow(2).mean(axis=1)
        return squares.groupby(nominal["setting_deg"]).mean().pow(0.5)

    @cached_property
    def coupling(self) -> pd.DataFrame:
        """Mean coupling term of the pointwise model over a primitive, and its step from setting to setting.

        One row per `primitive` and `setting_deg`: `mean`, `std` over the runs; `step` from the setting below
        with its 95 % interval `low`, `high` (Welch, runs are independent).
        """
        rows = []
        fed = self.traces[self.traces["model"] == POINTWISE]
        each = fed.groupby(["primitive", "setting_deg", "run"])["coupling"].mean()
        for name in self.primitives:
            before = None
            for setting in self.settings_deg:
                values = each[name, setting].to_numpy()
                row: dict[str, object] = {"primitive": name, "setting_deg": setting, "mean": values.mean()}
                row |= {"std": np.std(values, ddof=1) if len(values) > 1 else np.nan}
                if before is not None:
                    step = welch(values, before)
                    row |= {"step": step.value, "low": step.low, "high": step.high}
                rows.append(row)
                before = values
        return pd.DataFrame(rows, columns=["primitive", "setting_deg", "mean", "std", "step", "low", "high"])

    def path_comparison(self, seen_deg: Sequence[float]) -> pd.DataFrame:
        """Errors of the unrolled path, pointwise beside unrolled, in settings learned from and others.

        Returns one row per `primitive` and `seen`: `count` of demonstrations, mean and std of both models,
        the mean paired difference `lower_deg` (pointwise minus unrolled) with its `half_width`, and the
        `verdict` on the unrolled model.
        """
        keys = ["primitive", "setting_deg", "demonstration"]
        wide = self.path_errors.pivot_table("error_deg", keys, "model").reset_index()
        wide["seen"] = wide["setting_deg"].isin(list(seen_deg))
        rows = []
        for name in self.primitives:
            for seen in (True, False):
                part = wide[(wide["primitive"] == name) & (wide["seen"] == seen)]
                if len(part):
                    row: dict[str, object] = {"primitive": name, "seen": seen, "count": len(part)}
                    for model in (POINTWISE, UNROLLED):
                        row |= {f"{model}_deg": part[model].mean(), f"{model}_std": part[model].std()}
                    lower, half_width = mean_interval((part[POINTWISE] - part[UNROLLED]).to_numpy())
                    row |= {"lower_deg": lower, "half_width": half_width}
                    rows.append(row | {"verdict": str(verdict(lower - half_width, lower + half_width))})
        return pd.DataFrame(rows)


@dataclass(frozen=True)
class FeedbackResults:
    """What the feedback stages wrote."""

    primitives: Sequence[str]  # names of all primitives in order of time
    unrolls: Sequence[Demonstration]  # nominal executions in the default setting
    unroll_cuts: Cuts  # of these
    expected: Mapping[str, VectorPrimitive]  # expected traces by primitive
    datasets: Mapping[str, CouplingDataset]  # by primitive, of all settings
    checks: Mapping[str, pd.DataFrame]  # of `coupling_targets.coupling_dataset`, by primitive
    networks: Mapping[str, CouplingModel]  # the pointwise models by primitive
    comparison: pd.DataFrame  # of `feedback_models.compare_representations`, with `primitive`
    orderings: pd.DataFrame  # of `feedback_models.paired_orderings`, with `primitive`
    seen_deg: Sequence[float]  # settings that are learned from
    board: BoardResults  # what was executed with the models

    @cached_property
    def adapted(self) -> list[str]:
        """Primitives with feedback, in order of time."""
        return [name for name in self.primitives if name in self.datasets]

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
        """`channel 25`, and whose electrode it is."""
        finger, electrode = divmod(channel, len(ELECTRODES_MM))
        return f"channel {channel + 1} ({FINGERS[finger]} finger, electrode {electrode + 1})"

    @cached_property
    def expected_errors(self) -> tuple[float, float]:
        """Counts, rms over everything: the expected trace off the mean run, and the std of the runs."""
        off, spread = [], []
        for name in self.primitives:
            runs, learned = unroll_traces(self, name)
            off.append(np.mean((runs.mean(axis=0) - learned) ** 2))
            spread.append(np.mean(runs.var(axis=0, ddof=1)) if len(runs) > 1 else np.nan)
        return float(np.sqrt(np.mean(off))), float(np.sqrt(np.mean(spread)))

    @property
    def folds(self) -> int:
        """Folds of the comparison."""
        return self.comparison["fold"].nunique()

    @cached_property
    def coupling_checks(self) -> pd.DataFrame:
        """`checks` of all primitives."""
        return pd.concat(
            [self.checks[name].assign(primitive=name) for name in self.adapted], ignore_index=True
        )

    @cached_property
    def model_errors(self) -> pd.DataFrame:
        """Mean and std over the folds of the NMSE.

        One row per primitive, representation and stopping: `<part>_mean` and `<part>_std` of every part, and
        `dimensions`, mean size of the code.
        """
        rows = []
        grouped = self.comparison.groupby(["primitive", "representation", "stopping"])
        for key in ((p, r, s) for p in self.adapted for r in REPRESENTATIONS for s in STOPPINGS):
            if key in grouped.groups:
                group = grouped.get_group(key)
                row = dict(zip(("primitive", "representation", "stopping"), key, strict=True))
                for part in PARTS:
                    row |= {f"{part}_mean": group[part].mean(), f"{part}_std": group[part].std()}
                rows.append(row | {"dimensions": group["dimensions"].mean()})
        return pd.DataFrame(rows)

    def model_error(self, primitive: str, representation: str, stopping: str) -> pd.Series:
        """A row of `model_errors`."""
        table = self.model_errors.set_index(["primitive", "representation", "stopping"])
        return table.loc[(primitive, representation, stopping)]

    @cached_property
    def demonstrated_costs(self) -> pd.DataFrame:
        """Scores of the corrected demonstrations that `board` holds, as `execution_scores`."""
        board = self.board
        cuts = commanded_cuts(board.corrected, self.primitives)
        scored = {name: cuts[name] for name in board.primitives}
        return execution_scores(board.corrected, scored, nominal_orientation(self.unrolls), board.axis)

    def dominant(self, primitive: str) -> tuple[np.ndarray, float, float] | None:
        """Figure IV.16 bottom; None of a network that has no phase kernels.

        Returns (N, H) whether a node is among those that weigh most for a phase kernel, and how many of them
        neighbouring kernels and any two kernels share on average.
        """
        weights = self.networks[primitive].arrays().get("phase_weights")
        if weights is None:
            return None
        dominant = dominant_features(weights)
        common = dominant.astype(int) @ dominant.T.astype(int)
        any_two = common[np.triu_indices(len(common), 1)]
        return dominant, float(np.diag(common, 1).mean()), float(any_two.mean())


def sharing_over_phase(dominant: np.ndarray) -> float:
    """Correlation of how many dominant nodes two phase kernels share with their distance, over all pairs.

    Negative where nodes come and go with the phase. In permuted order, or with permuted weights, it is 0 on
    average, and 0 where the nodes are the same at every phase.

    `dominant`: (N, H) of `dominant_features`.
    """
    first, second = np.triu_indices(len(dominant), 1)
    shared = (dominant.astype(int) @ dominant.T.astype(int))[first, second]
    return float(np.corrcoef(shared, second - first)[0, 1]) if np.ptp(shared) else 0.0


def _smallest_step(values: np.ndarray) -> float:
    """Of values (N,) that should all rise or all fall; negative where one goes the other way."""
    steps = np.diff(values)
    return float((np.sign(steps.sum()) * steps).min()) if len(steps) else 0.0


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

    Returns (R, T, E) counts of the runs and (T, E) of the expected trace.
    """
    runs = []
    for run in results.unrolls:
        ends = results.unroll_cuts[primitive].loc[run.name, ["start_s", "end_s"]]
        first, last = (round(float(end) / run.dt) for end in ends)
        part = vector.without_offset(run.signal("tactile"))[first : last + 1]
        runs.append(signals.time_normalised(part, SAMPLES))
    learned = results.expected[primitive]
    return np.stack(runs), vector.expected_traces(learned, SAMPLES, learned.duration / (SAMPLES - 1))


def dominant_features(phase_weights: np.ndarray, count: int = 10) -> np.ndarray:
    """Which hidden nodes weigh most for each phase kernel (figure IV.16 bottom).

    `phase_weights`: (N, H) from hidden nodes into kernels. Returns (N, H) True for the nodes with the largest
    |weight| into a kernel.
    """
    order = np.argsort(-np.abs(phase_weights), axis=1, kind="stable")
    dominant = np.zeros(phase_weights.shape, dtype=bool)
    np.put_along_axis(dominant, order[:, :count], True, axis=1)
    return dominant
