"""Segmentation and primitives (IV.5, IV.9.2): what the stages wrote, and the numbers that follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.primitives.fitting import FitParameters, Segment, reproduction_summary, segment_paths
from structlearn.primitives.sequence import PosePrimitive, largest_acceleration_jump
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.prose import level_name
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.cut_errors import (
    alignment_comparison,
    cut_errors,
    errors_by_level,
    errors_by_seed,
    mean_cut_errors_ms,
    paired_comparison,
    wins_at_every_noise_level,
)
from structlearn.segmentation.parameters import PrimitiveParameters, SegmentParameters
from structlearn.segmentation.segments import Segmentation

FIT_METRICS = ("mean_mm", "max_mm", "end_mm", "mean_deg", "end_deg")
LEFT_OUT_METRICS = ("mean_mm", "mean_deg")


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

    def metrics(self) -> Metrics:
        """Flat.

        `fit_<primitive>_*` are of primitives learned from all demonstrations by the chosen regression: the
        mean over demonstrations of the mean error, the largest of the largest and of the end errors.
        `left_one_out_<primitive>_*` are means over demonstrations that were not learned from.
        `downsampling_*` are means over people of `downsampling_worst`.
        """
        values: Metrics = {
            "demonstrations": len(self.was_cut),
            "demonstrations_left_out": len(self.segmentation.left_out),
            "simulated": True,
        }
        if self.errors_of_cuts is not None:
            for row in self.errors_of_cuts.itertuples():
                values[f"cut_error_ms_{row.method}"] = row.mean_ms
        for row in self.sweep.itertuples():
            values[f"sweep_cut_error_ms_{row.method}_{level_name(row.noise_mm)}mm"] = row.mean_ms
        wins = wins_at_every_noise_level(self.sweep)
        values["wls_wins_at_every_noise_level"] = wins
        if self.alignment is not None:
            for row in self.alignment.itertuples():
                values[f"spread_mm_{row.method}_{row.primitive}"] = row.spread_mm
                values[f"alignment_gain_mm_{row.method}_{row.primitive}"] = row.gain_mm
        if len(self.downsampling_worst):
            worst = self.downsampling_worst.mean()
            values["downsampling_work_g2"] = float(worst["work"])
            values["downsampling_shift_samples"] = float(worst["shift_samples"])
            values["downsampling_shift_samples_text"] = float(worst["shift_samples_text"])
        parts = ((False, "fit", FIT_METRICS), (True, "left_one_out", LEFT_OUT_METRICS))
        for left_out, prefix, names in parts:
            for row in self.fitted(left_out).to_dict("records"):
                values |= {f"{prefix}_{row['primitive']}_{name}": row[name] for name in names if name in row}
        for key, jump in zip(("nominal", "generalised"), self.acceleration_jumps.values(), strict=False):
            values[f"acceleration_jump_{key}"] = jump
        return values
