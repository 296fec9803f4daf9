"""What the stages and studies of the scraping testbed wrote, and what its three pages read from that."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.artefacts import read_table
from structlearn.core.metrics import matching
from structlearn.feedback.coupling_dataset import PARTS, CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel, read_networks
from structlearn.feedback.feedback_models import POINTWISE, REPRESENTATIONS, STOPPINGS
from structlearn.primitives import vector
from structlearn.primitives.fitting import FitParameters, Segment, reproduction_summary, segment_paths
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive, largest_acceleration_jump
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.claims import UNKNOWN
from structlearn.reporting.studies import Study, read_study
from structlearn.segmentation import cut_errors
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.parameters import PrimitiveParameters, SegmentParameters
from structlearn.segmentation.segments import Segmentation, commanded_cuts, read_segmentation
from structlearn.tactile.electrodes import ELECTRODES_MM
from structlearn.testbeds.scraping import files
from structlearn.testbeds.scraping.page.executed import ExecutionResults, RefinementResults, welch
from structlearn.testbeds.scraping.protocol.execution_scores import (
    AFTER,
    BEFORE,
    NOMINAL,
    execution_scores,
    nominal_orientation,
)
from structlearn.testbeds.scraping.world.testbed import FINGERS

SAMPLES = 101  # Points over normalised time on which curves are compared
PEOPLE = "scraping/people"
"""Studies that the pages rest on: of people, and of parameters of the refinement."""


@dataclass(frozen=True)
class SegmentationResults:
    """Segmentation and primitives (IV.5, IV.9.2)."""

    demonstrations: Sequence[Demonstration]  # the complete ones, those that could not be cut among them
    segmentation: Segmentation  # their cuts
    noise: pd.DataFrame  # of `cut_sweep.noise_sweep`
    downsampling: pd.DataFrame  # of `cut_errors.downsampling_effect`
    downsampling_people: pd.DataFrame  # of `cut_sweep.downsampling_sweep`
    primitives: Sequence[PosePrimitive]  # learned from all demonstrations that were cut
    reproduction: pd.DataFrame  # of `fitting.cross_validation`
    nominal: pd.DataFrame  # table of the sequence as demonstrated
    generalised: pd.DataFrame  # table of the sequence in a new situation
    segment_parameters: SegmentParameters
    fit_parameters: FitParameters

    @property
    def found_primitives(self) -> list[PrimitiveParameters]:
        """Primitives with an axis, which have their own cut points."""
        return [one for one in self.segment_parameters.primitives if one.axis != "between"]

    @cached_property
    def was_cut(self) -> list[Demonstration]:
        """Demonstrations that could be cut."""
        names = set(self.segmentation.cuts["demonstration"])
        return [one for one in self.demonstrations if one.name in names]

    @cached_property
    def reference(self) -> Demonstration:
        """The demonstration with which the others are aligned."""
        return next(one for one in self.was_cut if one.name == self.segmentation.reference)

    @cached_property
    def guesses(self) -> list[Demonstration]:
        """Demonstrations that were aligned with the reference."""
        return [one for one in self.was_cut if one is not self.reference]

    @property
    def example(self) -> Demonstration:
        """The demonstration shown in detail: the first that was aligned."""
        return (self.guesses or [self.reference])[0]

    @property
    def sequences(self) -> dict[str, pd.DataFrame]:
        """Both sequences by the name that figures and claims give them."""
        return {"as demonstrated": self.nominal, "new situation": self.generalised}

    @cached_property
    def errors_of_cuts(self) -> pd.DataFrame | None:
        """Mean and largest cut error by method; None where the true cut points are not known."""
        count = len(self.segmentation.primitives)
        known = [one.true_segments is not None and len(one.true_segments) == count for one in self.guesses]
        if not known or not all(known):
            return None
        errors = cut_errors.cut_errors(self.demonstrations, self.segmentation)
        return cut_errors.mean_cut_errors_ms(errors).reset_index()

    @cached_property
    def alignment(self) -> pd.DataFrame | None:
        """See `cut_errors.alignment_comparison`; None where only the reference was cut."""
        if not self.guesses:
            return None
        return cut_errors.alignment_comparison(self.was_cut, self.segmentation, self.found_primitives)

    @cached_property
    def downsampling_worst(self) -> pd.DataFrame:
        """Worst values of down-sampling by person of the sweep; empty of one factor g.

        `work` times g² where it is furthest from 1, and the largest `shift_samples` and `shift_samples_text`.
        """
        effect = self.downsampling_people
        first = effect["factor"].min()
        rest = effect[effect["factor"] > first]
        by_person = rest.assign(work=rest["work"] * (rest["factor"] / first) ** 2).groupby("seed")
        work = by_person["work"].agg(lambda work: work.loc[(work - 1.0).abs().idxmax()])
        return by_person[["work", "shift_samples", "shift_samples_text"]].max().assign(work=work)

    @cached_property
    def errors_by_seed(self) -> pd.DataFrame:
        """Cut errors of the sweep by person, see `cut_errors.errors_by_seed`."""
        return cut_errors.errors_by_seed(self.noise)

    @cached_property
    def sweep(self) -> pd.DataFrame:
        """See `cut_errors.errors_by_level`."""
        return cut_errors.errors_by_level(self.errors_by_seed)

    @cached_property
    def sweep_comparison(self) -> pd.DataFrame:
        """See `cut_errors.paired_comparison`."""
        return cut_errors.paired_comparison(self.errors_by_seed)

    @cached_property
    def fit(self) -> pd.DataFrame:
        """See `fitting.reproduction_summary`."""
        return reproduction_summary(self.reproduction)

    @cached_property
    def segments(self) -> dict[str, list[Segment]]:
        """Segments that the primitives were learned from, by primitive."""
        cuts, cutoff = self.segmentation.results, self.fit_parameters.smoothing_hz
        return {name: segment_paths(self.was_cut, cuts[name], cutoff) for name in cuts}

    @cached_property
    def acceleration_jumps(self) -> list[float]:
        """Largest relative jump of the acceleration at a switch of each sequence; none without a switch."""
        sequences = (self.nominal, self.generalised) if len(self.primitives) > 1 else ()
        return [largest_acceleration_jump(table) for table in sequences]

    def most_refined_guess(self, primitive: str) -> Demonstration:
        """The guess whose cut points by ordinary and by weighted least squares differ most."""
        ordinary, weighted = (
            self.segmentation.result(primitive, method)[["start_s", "end_s"]] for method in ("ls", RESULT)
        )
        difference = (ordinary - weighted).abs().sum(axis=1)
        return max(self.guesses, key=lambda guess: difference[guess.name])


@dataclass(frozen=True)
class FeedbackResults(ExecutionResults):
    """Feedback models and executions with and without (IV.6, IV.9.3); `example_deg` is the largest tilt."""

    primitives: Sequence[str]  # names of all primitives in order of time
    unrolls: Sequence[Demonstration]  # nominal executions in the default setting
    expected: Mapping[str, VectorPrimitive]  # expected traces by primitive
    datasets: Mapping[str, CouplingDataset]  # by primitive, of all settings
    checks: pd.DataFrame  # of `coupling_targets.coupling_dataset`, with `primitive`
    networks: Mapping[str, CouplingModel]  # the pointwise models by primitive
    comparison: pd.DataFrame  # of `feedback_models.compare_representations`, with `primitive`
    orderings: pd.DataFrame  # of `feedback_models.paired_orderings`, with `primitive`
    seen_deg: Sequence[float]  # settings that are learned from
    traces: pd.DataFrame  # of `execution_scores.traces`
    path_errors: pd.DataFrame  # of `corrected_paths.path_errors`
    corrected: Sequence[Demonstration]  # corrected demonstrations in the setting `example_deg`
    force_n: float  # that the robot was asked to hold

    @cached_property
    def corrected_deg(self) -> list[float]:
        """Settings with corrections, rising."""
        return np.unique(np.concatenate([one.setting for one in self.datasets.values()])).tolist()

    @property
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
    def felt(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """By primitive, counts (R, T, E) of the executions over normalised time, and (T, E) expected ones."""
        cuts, found = commanded_cuts(self.unrolls, self.primitives), {}
        for name in self.primitives:
            runs = []
            for run in self.unrolls:
                first, last = (round(float(end) / run.dt) for end in cuts[name].loc[run.name])
                part = vector.without_offset(run.signal("tactile"))[first : last + 1]
                runs.append(signals.time_normalised(part, SAMPLES))
            learned = self.expected[name]
            shown = vector.expected_traces(learned, SAMPLES, learned.duration / (SAMPLES - 1))
            found[name] = np.stack(runs), shown
        return found

    @property
    def expected_errors(self) -> tuple[float, float]:
        """Counts, rms over everything: the expected trace off the mean run, and the std of the runs."""
        off = [np.mean((runs.mean(axis=0) - learned) ** 2) for runs, learned in self.felt.values()]
        spread = [
            np.mean(runs.var(axis=0, ddof=1)) if len(runs) > 1 else np.nan for runs, _ in self.felt.values()
        ]
        return float(np.sqrt(np.mean(off))), float(np.sqrt(np.mean(spread)))

    @cached_property
    def model_errors(self) -> pd.DataFrame:
        """NMSE over the folds by primitive, representation and stopping, and mean `dimensions` of the code.

        Columns `<part>_mean` and `<part>_std`.
        """
        grouped = self.comparison.groupby(["primitive", "representation", "stopping"])
        errors = {f"{part}_{how}": (part, how) for part in PARTS for how in ("mean", "std")}
        found = grouped.agg(**errors, dimensions=("dimensions", "mean"))
        order = product(self.adapted, REPRESENTATIONS, STOPPINGS)
        return found.loc[[key for key in order if key in found.index]]

    @cached_property
    def demonstrated_costs(self) -> pd.DataFrame:
        """Scores of the corrected demonstrations, see `execution_scores`."""
        cuts = commanded_cuts(self.corrected, self.primitives)
        scored = {name: cuts[name] for name in self.adapted}
        return execution_scores(self.corrected, scored, nominal_orientation(self.unrolls), self.axis)

    @cached_property
    def nominal(self) -> pd.DataFrame:
        """Executions without feedback: means over runs per `setting_deg` and `primitive`."""
        rows = matching(self.scores, model=NOMINAL).drop(columns=["run", "model"])
        return rows.groupby(["setting_deg", "primitive"]).mean()

    @cached_property
    def felt_counts(self) -> pd.Series:
        """By `setting_deg`, rms over channels and time of the deviation from what was expected, counts.

        Of executions without feedback: on the level board it is how much one contact differs from another.
        """
        nominal = matching(self.traces, model=NOMINAL)
        squares = nominal.filter(like="channel_").pow(2).mean(axis=1)
        return squares.groupby(nominal["setting_deg"]).mean().pow(0.5)

    @cached_property
    def coupling(self) -> pd.DataFrame:
        """Mean coupling term of the pointwise model over a primitive, and its step from setting to setting.

        One row per `primitive` and `setting_deg`: `mean`, `std` over the runs; `step` from the setting below
        with its 95 % interval `low`, `high` (Welch, runs are independent).
        """
        fed = matching(self.traces, model=POINTWISE)
        each = fed.groupby(["primitive", "setting_deg", "run"])["coupling"].mean()
        rows = []
        for name in self.adapted:
            values = [each[name, setting] for setting in self.settings_deg]
            steps = [UNKNOWN, *(welch(above, below) for below, above in pairwise(values))]
            for setting, its, step in zip(self.settings_deg, values, steps, strict=True):
                rows.append((name, setting, its.mean(), its.std(), step.value, step.low, step.high))
        return pd.DataFrame(rows, columns=["primitive", "setting_deg", "mean", "std", "step", "low", "high"])

    def dominant(self, primitive: str) -> tuple[np.ndarray, float, float] | None:
        """Figure IV.16 bottom; None of a network without phase kernels.

        Returns (N, H) of `dominant_features`, and how many of these nodes neighbouring kernels and any two
        kernels share on average.
        """
        weights = self.networks[primitive].arrays().get("phase_weights")
        if weights is None:
            return None
        dominant = dominant_features(weights)
        shared, distance = shared_nodes(dominant)
        return dominant, float(shared[distance == 1].mean()), float(shared.mean())


@dataclass(frozen=True)
class ScrapingResults:
    """What the report rests on."""

    segmentation: SegmentationResults
    feedback: FeedbackResults
    refinement: RefinementResults
    study: Study | None  # over people; None where it was not run with these parameters
    parameters: Mapping[str, Any]  # by key of `params.yaml`


def shared_nodes(dominant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many dominant nodes each pair of phase kernels shares, and the distance between both kernels."""
    first, second = np.triu_indices(len(dominant), 1)
    return (dominant.astype(int) @ dominant.T.astype(int))[first, second], second - first


def sharing_over_phase(dominant: np.ndarray) -> float:
    """Correlation of how many dominant nodes two phase kernels share with their distance, over all pairs.

    Negative where nodes come and go with the phase; 0 on average in permuted order or with permuted weights,
    and 0 where the nodes are the same at every phase. `dominant`: (N, H) of `dominant_features`.
    """
    shared, distance = shared_nodes(dominant)
    return float(np.corrcoef(shared, distance)[0, 1]) if np.ptp(shared) else 0.0


def dominant_features(phase_weights: np.ndarray, count: int = 10) -> np.ndarray:
    """Which hidden nodes have the largest |weight| into each phase kernel, of (N, H) weights: (N, H) bool."""
    order = np.argsort(-np.abs(phase_weights), axis=1, kind="stable")
    dominant = np.zeros(phase_weights.shape, dtype=bool)
    np.put_along_axis(dominant, order[:, :count], True, axis=1)
    return dominant


def informative_channel(dataset: CouplingDataset) -> tuple[int, float]:
    """The channel whose mean deviation in a demonstration correlates most with the setting, and how much."""
    means = pd.DataFrame(dataset.deviation).groupby([dataset.setting, dataset.demonstration]).mean()
    setting = pd.Series(means.index.get_level_values(0).to_numpy(float), means.index)
    correlation = means.corrwith(setting).fillna(0.0)  # a channel that never varies has none
    channel = int(np.argmax(correlation.abs()))
    return channel, float(correlation[channel])


def read_results(found: files.ScrapingFiles, parameters: Mapping[str, Any]) -> ScrapingResults:
    """Outputs of the stages and of studies."""
    folder = found.data / "feedback/scraping"
    primitives = read_primitives(found.data / "primitives/scraping/primitives.safetensors")
    names, datasets = [one.name for one in primitives], files.read_datasets(folder / "dataset")
    axis = parameters["coupling_dataset"].unit_axis
    largest, tilt = max(parameters["evaluate_feedback"].settings_deg), parameters["refine"].setting_deg

    def tables(*stored: str) -> dict[str, Any]:
        return {name: found.table(name) for name in stored}

    segmentation = SegmentationResults(
        demonstrations=found.runs("nominal"),
        segmentation=read_segmentation(found.data / "segments/scraping"),
        primitives=primitives,
        segment_parameters=parameters["segment"],
        fit_parameters=parameters["fit_primitives"],
        **tables("noise", "downsampling", "downsampling_people", "reproduction", "nominal", "generalised"),
    )
    checks = [
        read_table(folder / f"dataset/{files.CHECKS}{name}.parquet").assign(primitive=name)
        for name in names
        if name in datasets
    ]
    feedback = FeedbackResults(
        examples={model: found.runs_at(largest, files.CLOSED_LOOP, model) for model in (NOMINAL, POINTWISE)},
        example_deg=largest,
        axis=axis,
        primitives=names,
        unrolls=found.runs("unrolls"),
        expected=files.read_expected(folder / "expected"),
        datasets=datasets,
        checks=pd.concat(checks, ignore_index=True),
        networks=read_networks(folder / f"models/{POINTWISE}.safetensors"),
        seen_deg=parameters["coupling_dataset"].settings_deg,
        corrected=found.runs_at(largest, files.CORRECTIONS),
        force_n=parameters["testbed"].control.force_n,
        **tables("comparison", "orderings", "scores", "traces", "path_errors"),
    )
    examples = {model: found.runs_at(tilt, files.REFINED, model) for model in (NOMINAL, BEFORE, AFTER)}
    refinement = RefinementResults(
        scores=found.table("refined_scores"),
        examples={model: runs for model, runs in examples.items() if runs},
        example_deg=tilt,
        axis=axis,
        parameters=parameters["refine"],
        **tables("history", "search"),
    )
    return ScrapingResults(segmentation, feedback, refinement, read_study(PEOPLE), parameters)
