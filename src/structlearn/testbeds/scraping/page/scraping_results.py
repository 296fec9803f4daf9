"""Numbers of the scraping testbed: the tables and the metrics that its page shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.primitives.fitting import FitParameters, Segment, reproduction_summary, segment_paths
from structlearn.primitives.sequence import PosePrimitive, largest_acceleration_jump
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.prose import level_name
from structlearn.segmentation import method_comparison
from structlearn.segmentation.cut_errors import cut_errors, mean_cut_errors_ms
from structlearn.segmentation.parameters import PrimitiveParameters, SegmentParameters
from structlearn.segmentation.result import RESULT, Segmentation
from structlearn.testbeds.scraping.page import feedback_results
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults

FIT_METRICS = ("mean_mm", "max_mm", "end_mm", "mean_deg", "end_deg")
LEFT_OUT_METRICS = ("mean_mm", "mean_deg")


@dataclass(frozen=True)
class ScrapingResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        demonstrations: the complete ones, those that could not be cut among them.
        segmentation: their cuts.
        noise: of `simulation.cut_sweep.noise_sweep`; empty where the task is not the simulated one.
        downsampling: of `segmentation.evaluation.downsampling_effect`.
        primitives: learned from all demonstrations that were cut.
        reproduction: of `segmentation.learning.cross_validation`.
        nominal: table of the sequence as demonstrated.
        generalised: table of the sequence in a new situation.
        segment_parameters: of the segmentation.
        fit_parameters: of the primitives.
        feedback: of the feedback stages; None where the primitives were not executed.
    """

    demonstrations: Sequence[Demonstration]
    segmentation: Segmentation
    noise: pd.DataFrame
    downsampling: pd.DataFrame
    primitives: Sequence[PosePrimitive]
    reproduction: pd.DataFrame
    nominal: pd.DataFrame
    generalised: pd.DataFrame
    segment_parameters: SegmentParameters
    fit_parameters: FitParameters
    feedback: FeedbackResults | None = None

    @cached_property
    def simulated(self) -> bool:
        """Whether any demonstration was simulated."""
        return any(demonstration.simulated for demonstration in self.demonstrations)

    @cached_property
    def found_primitives(self) -> list[PrimitiveParameters]:
        """Primitives that have an axis, and so cut points of their own."""
        return [primitive for primitive in self.segment_parameters.primitives if primitive.axis != "between"]

    @cached_property
    def was_cut(self) -> list[Demonstration]:
        """Demonstrations that could be cut."""
        names = set(self.segmentation.cuts["demonstration"])
        return [demonstration for demonstration in self.demonstrations if demonstration.name in names]

    @cached_property
    def reference(self) -> Demonstration:
        """The demonstration with which the others are aligned."""
        return next(one for one in self.was_cut if one.name == self.segmentation.reference)

    @cached_property
    def guesses(self) -> list[Demonstration]:
        """Demonstrations that were aligned with the reference."""
        return [one for one in self.was_cut if one.name != self.segmentation.reference]

    @cached_property
    def example(self) -> Demonstration:
        """The demonstration shown in detail: the first that was aligned."""
        return (self.guesses or [self.reference])[0]

    @cached_property
    def has_orientation(self) -> bool:
        """Whether the primitives turn the tool too."""
        return all(primitive.orientation is not None for primitive in self.primitives)

    @cached_property
    def sequences(self) -> dict[str, pd.DataFrame]:
        """Both sequences by the title that figures give them."""
        return {"As demonstrated": self.nominal, "New situation": self.generalised}

    @cached_property
    def errors_of_cuts(self) -> pd.DataFrame | None:
        """Mean and largest cut error by method; None where the true cut points are not known."""
        count = len(self.segmentation.primitives)
        known = [d.true_segments is not None and len(d.true_segments) == count for d in self.guesses]
        if not known or not all(known):
            return None
        errors = cut_errors(self.demonstrations, self.segmentation)
        return mean_cut_errors_ms(errors).reset_index()

    @cached_property
    def alignment(self) -> pd.DataFrame | None:
        """See `method_comparison.alignment_comparison`; None where only the reference was cut."""
        if not self.guesses:
            return None
        return method_comparison.alignment_comparison(self.was_cut, self.segmentation, self.found_primitives)

    @cached_property
    def sweep(self) -> pd.DataFrame:
        """See `method_comparison.errors_by_level`."""
        return method_comparison.errors_by_level(method_comparison.errors_by_seed(self.noise))

    @cached_property
    def sweep_comparison(self) -> pd.DataFrame:
        """See `method_comparison.paired_comparison`."""
        return method_comparison.paired_comparison(method_comparison.errors_by_seed(self.noise))

    @cached_property
    def sweep_left_out(self) -> int:
        """Number of demonstrations in the sweep that could not be cut."""
        return int((self.noise["method"] == "left_out").sum())

    @cached_property
    def fit(self) -> pd.DataFrame:
        """See `segmentation.learning.reproduction_summary`."""
        return reproduction_summary(self.reproduction)

    @cached_property
    def segments(self) -> dict[str, list[Segment]]:
        """Segments that the primitives were learned from, by primitive."""
        cutoff = self.fit_parameters.smoothing_hz
        return {
            name: segment_paths(self.was_cut, self.segmentation.result(name), cutoff)
            for name in self.segmentation.primitives
        }

    @cached_property
    def acceleration_jumps(self) -> dict[str, float]:
        """Largest relative jump of the acceleration at a switch, of both sequences; none without a switch."""
        if len(self.primitives) < 2:
            return {}
        tables = {"nominal": self.nominal, "generalised": self.generalised}
        return {name: largest_acceleration_jump(table) for name, table in tables.items()}

    def most_refined_guess(self, primitive: str) -> Demonstration:
        """The guess whose cut points by ordinary and by weighted least squares differ most."""
        ordinary, weighted = (
            self.segmentation.result(primitive, method)[["start_s", "end_s"]] for method in ("ls", RESULT)
        )
        difference = (ordinary - weighted).abs().sum(axis=1)
        return max(self.guesses, key=lambda guess: difference[guess.name])


def tables(results: ScrapingResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name, those without content left out."""
    candidates = {
        "demonstrations_left_out": results.segmentation.left_out,
        "cut_points": results.segmentation.cuts,
        "cut_errors": results.errors_of_cuts,
        "alignment": results.alignment,
        "noise_sweep": results.sweep,
        "noise_sweep_comparison": results.sweep_comparison,
        "downsampling": results.downsampling,
        "reproduction": results.fit,
    }
    if results.feedback is not None:
        candidates |= feedback_results.tables(results.feedback)
    return {name: table for name, table in candidates.items() if table is not None and len(table) > 0}


def metrics(results: ScrapingResults) -> Metrics:
    """The flat metrics of the testbed; what is not known (true cut points, orientations) is left out.

    `fit_<primitive>_*` are of primitives learned from all demonstrations by the chosen regression: the mean
    over demonstrations of the mean error, the largest of the largest and of the end errors.
    `left_one_out_<primitive>_*` are means over demonstrations that were not learned from. Those of feedback
    are described in `feedback_results.metrics`.
    """
    values: Metrics = {
        "demonstrations": len(results.was_cut),
        "demonstrations_left_out": len(results.segmentation.left_out),
        "simulated": results.simulated,
    }
    if results.errors_of_cuts is not None:
        for row in results.errors_of_cuts.itertuples():
            values[f"cut_error_ms_{row.method}"] = row.mean_ms
    for row in results.sweep.itertuples():
        values[f"sweep_cut_error_ms_{row.method}_{level_name(row.noise_mm)}mm"] = row.mean_ms
    if len(results.sweep):
        values["wls_wins_at_every_noise_level"] = method_comparison.wins_at_every_noise_level(results.sweep)
    if results.alignment is not None:
        for row in results.alignment.itertuples():
            values[f"spread_mm_{row.method}_{row.primitive}"] = row.spread_mm
    chosen = results.fit[results.fit["regression"] == results.fit_parameters.regression]
    for left_out, prefix, names in ((False, "fit", FIT_METRICS), (True, "left_one_out", LEFT_OUT_METRICS)):
        for row in chosen[chosen["left_out"] == left_out].to_dict("records"):
            values |= {f"{prefix}_{row['primitive']}_{name}": row[name] for name in names if name in row}
    for name, jump in results.acceleration_jumps.items():
        values[f"acceleration_jump_{name}"] = jump
    if results.feedback is not None:
        values |= feedback_results.metrics(results.feedback)
    return values
