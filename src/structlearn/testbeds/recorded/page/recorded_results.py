"""What the page of the recorded data shows: gathered from the stages, and as metrics and tables."""

from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.primitives.fitting import Segment
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.method_comparison import errors_by_level, errors_by_seed, paired_comparison
from structlearn.segmentation.result import RESULT
from structlearn.testbeds.recorded.page import (
    recorded_avoidance,
    recorded_corrections,
    recorded_dynamics,
    recorded_latent_touch,
)
from structlearn.testbeds.recorded.protocol.avoidance_representations import RecordedAvoidanceResults
from structlearn.testbeds.recorded.protocol.correction_splits import CorrectionResults
from structlearn.testbeds.recorded.protocol.latent_touch import LatentTouchResults
from structlearn.testbeds.recorded.protocol.panda_identification import RecordedDynamicsResults

STRONG_RANGE = 20
"""Counts; an electrode that moves more than this stands clear of the sensor's noise of half a count."""


@dataclass(frozen=True)
class RecordedResults:
    """All that the page shows; the attributes are results of the functions in `recorded`."""

    reach_segments: list[Segment]
    reach_primitive: PosePrimitive
    reach_errors: pd.DataFrame
    reach_cut_errors: pd.DataFrame
    own_spread_mm: float
    corrections: CorrectionResults
    unscrewing_segments: list[Segment]
    unscrewing_primitive: PosePrimitive
    unscrewing_errors: pd.DataFrame
    execution: list[Demonstration]
    execution_path: pd.DataFrame
    execution_errors: pd.DataFrame
    electrode_scores: pd.DataFrame
    electrode_traces: pd.DataFrame
    clock_errors: pd.DataFrame
    slide_deviations: pd.DataFrame
    slide_statistics: pd.DataFrame
    avoidance: RecordedAvoidanceResults
    latent_touch: LatentTouchResults
    dynamics: RecordedDynamicsResults
    slide_torques: pd.DataFrame
    slide_payloads: pd.DataFrame

    @cached_property
    def by_seed(self) -> pd.DataFrame:
        """Mean cut error of the reaches per noise level, draw and method."""
        return errors_by_seed(self.reach_cut_errors)

    @cached_property
    def by_level(self) -> pd.DataFrame:
        """The same, over the draws."""
        return errors_by_level(self.by_seed)

    @cached_property
    def reach_fit(self) -> pd.DataFrame:
        """Distance of the primitive from the reaches, learned from or left out."""
        by = self.reach_errors.groupby("variant", sort=False)
        return pd.DataFrame(
            {
                "reaches": list(by.groups),
                "mean_mm": by["mean_mm"].mean().to_numpy(),
                "max_mm": by["max_mm"].max().to_numpy(),
                "end_max_mm": by["end_mm"].max().to_numpy(),
            }
        )

    @cached_property
    def electrodes(self) -> pd.DataFrame:
        """Error of the sensor primitives, over all electrodes and over those that move."""
        rows = []
        for primitive, its in self.electrode_scores.groupby("primitive", sort=False):
            strong = its[its["range"] > STRONG_RANGE]
            rows.append(
                {
                    "primitive": primitive,
                    "rms": its["rms"].median(),
                    "nmse": its["nmse"].median(),
                    "strong": len(strong),
                    "strong_nmse": strong["nmse"].mean(),
                }
            )
        return pd.DataFrame(rows)

    @cached_property
    def slides(self) -> pd.DataFrame:
        """Deviation from the expected traces by group of trials."""
        by = self.slide_deviations.groupby("group", sort=False)
        return pd.DataFrame(
            {
                "group": list(by.groups),
                "trials": by.size().to_numpy(),
                "median_rms": by["rms"].median().to_numpy(),
                "largest_rms": by["rms"].max().to_numpy(),
            }
        )


def metrics(results: RecordedResults) -> Metrics:
    """The flat metrics of the recorded data."""
    values: Metrics = {}
    for row in results.by_level.itertuples():
        level = f"{row.noise_mm:g}".replace(".", "p")
        if row.method == RESULT:
            values[f"reach_cut_error_ms_{level}mm"] = row.mean_ms
        else:
            values[f"reach_cut_error_ms_{level}mm_{row.method}"] = row.mean_ms
    prefixes = {"learned from": "reach_fit", "left out": "reach_left_ten_out"}
    for row in results.reach_fit.to_dict("records"):
        prefix = prefixes.get(row["reaches"], "reach_fit_unscaled")
        values |= {f"{prefix}_{name}": row[name] for name in ("mean_mm", "max_mm", "end_max_mm")}
    values["reach_own_spread_mm"] = results.own_spread_mm
    values |= recorded_corrections.metrics(results.corrections)
    errors = results.unscrewing_errors
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    values["unscrewing_mean_deg_single"] = single["mean_deg"].mean()
    values["unscrewing_mean_deg_joint"] = joint["mean_deg"].item()
    values["unscrewing_end_deg_single"] = single["end_deg"].max()
    values["unscrewing_end_deg_joint"] = joint["end_deg"].item()
    for row in results.execution_errors.itertuples():
        values[f"scraping_{row.primitive}_mean_mm"] = row.mean_mm
        values[f"scraping_{row.primitive}_mean_deg"] = row.mean_deg
    for row in results.electrodes.itertuples():
        values[f"electrodes_{row.primitive}_median_nmse"] = row.nmse
        values[f"electrodes_{row.primitive}_median_rms_counts"] = row.rms
        values[f"electrodes_{row.primitive}_strong_mean_nmse"] = row.strong_nmse
    for row in results.slides.itertuples():
        values[f"slides_{row.group.replace(' ', '_')}_median_rms_counts"] = row.median_rms
    pose = results.clock_errors.set_index("kind").loc["pose"]
    values["slides_clock_pose_rms_mm"] = 1e3 * pose["rms_error"]
    values |= recorded_avoidance.metrics(results.avoidance)
    values |= recorded_latent_touch.metrics(results.latent_touch)
    return values | recorded_dynamics.metrics(results.dynamics)


def tables(results: RecordedResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    return {
        "reach_cut_errors": results.by_level,
        "reach_comparison": paired_comparison(results.by_seed),
        "reach_reproduction": results.reach_errors,
        **recorded_corrections.tables(results.corrections),
        "unscrewing": results.unscrewing_errors,
        "execution": results.execution_errors,
        "electrodes": results.electrode_scores,
        "slide_clock": results.clock_errors,
        "slide_deviations": results.slide_deviations,
        **recorded_avoidance.tables(results.avoidance),
        **recorded_latent_touch.tables(results.latent_touch),
        **recorded_dynamics.tables(results.dynamics, results.slide_torques, results.slide_payloads),
    }
