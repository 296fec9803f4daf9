"""Segmentation and primitives (IV.5, IV.9.2): what the stages wrote, and the numbers that follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.primitives.fitting import FitParameters, Segment, reproduction_summary, segment_paths
from structlearn.primitives.sequence import PosePrimitive, largest_acceleration_jump
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.cut_errors import (
    alignment_comparison,
    cut_errors,
    errors_by_level,
    errors_by_seed,
    mean_cut_errors_ms,
    paired_comparison,
)
from structlearn.segmentation.parameters import PrimitiveParameters, SegmentParameters
from structlearn.segmentation.segments import Segmentation


@dataclass(frozen=True)
class SegmentationResults:
    """Outputs of the stages, and what follows from it."""

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
        return mean_cut_errors_ms(cut_errors(self.demonstrations, self.segmentation)).reset_index()

    @cached_property
    def alignment(self) -> pd.DataFrame | None:
        """See `cut_errors.alignment_comparison`; None where only the reference was cut."""
        if not self.guesses:
            return None
        return alignment_comparison(self.was_cut, self.segmentation, self.found_primitives)

    @cached_property
    def downsampling_worst(self) -> pd.DataFrame:
        """What is least true of down-sampling, by person of the sweep; empty of one factor g.

        `work` times g² where it is furthest from 1; `shift_samples`, `shift_samples_text`, the largest.
        """
        columns = ["work", "shift_samples", "shift_samples_text"]
        effect = self.downsampling_people
        first = effect["factor"].min()
        rest = effect[effect["factor"] > first]
        rest = rest.assign(work=rest["work"] * (rest["factor"] / first) ** 2)
        by_person = rest.groupby("seed")
        work = by_person["work"].agg(lambda work: work.loc[(work - 1.0).abs().idxmax()])
        return by_person[columns].max().assign(work=work)

    @cached_property
    def sweep(self) -> pd.DataFrame:
        """See `cut_errors.errors_by_level`."""
        return errors_by_level(errors_by_seed(self.noise))

    @cached_property
    def sweep_comparison(self) -> pd.DataFrame:
        """See `cut_errors.paired_comparison`."""
        return paired_comparison(errors_by_seed(self.noise))

    @cached_property
    def fit(self) -> pd.DataFrame:
        """See `fitting.reproduction_summary`."""
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
        """By sequence, largest relative jump of the acceleration at a switch; none without a switch."""
        if len(self.primitives) < 2:
            return {}
        return {name: largest_acceleration_jump(table) for name, table in self.sequences.items()}

    def most_refined_guess(self, primitive: str) -> Demonstration:
        """The guess whose cut points by ordinary and by weighted least squares differ most."""
        ordinary, weighted = (
            self.segmentation.result(primitive, method)[["start_s", "end_s"]] for method in ("ls", RESULT)
        )
        difference = (ordinary - weighted).abs().sum(axis=1)
        return max(self.guesses, key=lambda guess: difference[guess.name])

    def fitted(self, left_out: bool) -> pd.DataFrame:
        """Rows of `fit` by the chosen regression: of demonstrations left out, or of those learned from."""
        chosen = self.fit["regression"] == self.fit_parameters.regression
        return self.fit[chosen & (self.fit["left_out"] == left_out)]
