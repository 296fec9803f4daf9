"""What the page of the recorded data shows: gathered from the stages' tables, and as metrics."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.ground import signals
from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import mean_interval
from structlearn.primitives.fitting import Segment
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.prose import level_name
from structlearn.segmentation.method_comparison import errors_by_level, errors_by_seed
from structlearn.segmentation.result import RESULT
from structlearn.testbeds.recorded import names

STRONG_RANGE = 20
"""Counts; an electrode that moves more than this stands clear of the sensor's noise of half a count."""

AXES = ["x", "y", "z"]

SPREAD_SAMPLES = 500
"""Of a reach in normalised time, as in `human_reaches.own_spread_mm`."""


@dataclass(frozen=True)
class RecordedResults:
    """All that the page shows.

    Attributes:
        tables: of the stages, by the names of `files.TABLES`; they are what the protocols return.
        reach_segments: the 97 reaches.
        reach_primitive: learned from all of them.
        unscrewing_segments: the logs.
        unscrewing_primitive: learned from all of them.
        execution: recorded parts of the scraping execution in order.
    """

    tables: Mapping[str, pd.DataFrame]
    reach_segments: list[Segment]
    reach_primitive: PosePrimitive
    unscrewing_segments: list[Segment]
    unscrewing_primitive: PosePrimitive
    execution: list[Demonstration]

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @cached_property
    def by_seed(self) -> pd.DataFrame:
        """Mean cut error of the reaches per noise level, draw and method."""
        return errors_by_seed(self["cut_errors"])

    @cached_property
    def by_level(self) -> pd.DataFrame:
        """The same, over the draws."""
        return errors_by_level(self.by_seed)

    @cached_property
    def own_distances_mm(self) -> np.ndarray:
        """(97,) distance of every reach from the mean of all, in local frame and normalised time."""
        paths = [in_local_frame(position, "up").position for position, _ in self.reach_segments]
        curves = np.array([signals.time_normalised(path, SPREAD_SAMPLES) for path in paths])
        return 1e3 * np.linalg.norm(curves - curves.mean(axis=0), axis=2).mean(axis=1)

    @cached_property
    def reach_fit(self) -> pd.DataFrame:
        """Distance of the primitive from the reaches, learned from or left out."""
        by = self["reach_errors"].groupby("variant", sort=False)
        found = by.agg(mean_mm=("mean_mm", "mean"), max_mm=("max_mm", "max"), end_max_mm=("end_mm", "max"))
        return found.rename_axis("reaches").reset_index()

    @cached_property
    def electrodes(self) -> pd.DataFrame:
        """Error of the sensor primitives, over all electrodes and over those that move."""
        by = self["electrode_scores"].groupby("primitive", sort=False)
        strong = self.strong_electrodes.groupby("primitive")["nmse"]
        found = by.agg(rms=("rms", "median"), nmse=("nmse", "median"))
        found["strong"] = strong.size().reindex(found.index, fill_value=0)
        return found.assign(strong_nmse=strong.mean()).reset_index()

    @property
    def strong_electrodes(self) -> pd.DataFrame:
        """Scores of the electrodes that move by more than `STRONG_RANGE`."""
        return self["electrode_scores"][self["electrode_scores"]["range"] > STRONG_RANGE]

    @cached_property
    def slides(self) -> pd.DataFrame:
        """Deviation from the expected traces by group of trials."""
        by = self["slide_deviations"].groupby("group", sort=False)["rms"]
        return by.agg(trials="size", median_rms="median", largest_rms="max").reset_index()

    @property
    def slide_material(self) -> str:
        """Material whose expected traces the others are held against."""
        trials = self["slide_deviations"]
        return str(trials.loc[trials["group"] == "learned", "demonstration"].iloc[0]).split("_")[0]

    @cached_property
    def distances_by_reach(self) -> pd.DataFrame:
        """Distances of the left-out higher reaches, one row per reach: its mean over the splits."""
        return self["coupling_distances"].groupby("reach").mean(numeric_only=True)

    @cached_property
    def touch_scores(self) -> pd.DataFrame:
        """Mean errors of latent spaces and their `..._std`, by an entry of `TOUCH_ASKED` and `model`."""
        errors = ["reconstruction", "distances", "pressure"]
        by = self["touch_errors"].groupby(["learned_from", "asked_about", "new", "model"])[errors]
        scores = by.mean().join(by.std().add_suffix("_std")).sort_index()
        return scores[[key[:3] in names.TOUCH_ASKED for key in scores.index]]

    @cached_property
    def panda(self) -> pd.DataFrame:
        """NMSE on the test part by model and friction, in their order, and joint; mean over seeds."""
        return panda_errors(self, "test")


def panda_errors(results: RecordedResults, part: str) -> pd.DataFrame:
    """See `RecordedResults.panda`; `part` is `test` or `train`."""
    return errors_by_joint(results["panda_errors"], part)


def errors_by_joint(errors: pd.DataFrame, part: str) -> pd.DataFrame:
    """NMSE on a part by model and friction, in their order, and joint; mean over seeds.

    Args:
        errors: of `arm_identification.error_table`.
        part: one of its parts.
    """
    rows = errors[errors["part"] == part]
    wide = rows.pivot_table(index=["model", "friction"], columns="joint", values="nmse", sort=False)
    models, frictions = list(names.DYNAMICS_MODELS), list(names.FRICTIONS)
    keys = [(frictions.index(friction), models.index(model)) for model, friction in wide.index]
    return wide.iloc[sorted(range(len(keys)), key=keys.__getitem__)]


def metrics(results: RecordedResults) -> Metrics:
    """The flat metrics of the recorded data."""
    values: Metrics = {}
    for row in results.by_level.itertuples():
        method = "" if row.method == RESULT else f"_{row.method}"
        values[f"reach_cut_error_ms_{level_name(row.noise_mm)}mm{method}"] = row.mean_ms
    prefixes = {"learned from": "reach_fit", "left out": "reach_left_ten_out"}
    for row in results.reach_fit.to_dict("records"):
        prefix = prefixes.get(row["reaches"], "reach_fit_unscaled")
        values |= {f"{prefix}_{name}": row[name] for name in ("mean_mm", "max_mm", "end_max_mm")}
    values["reach_own_spread_mm"] = results.own_distances_mm.mean()
    values |= _correction_metrics(results)
    errors = results["unscrewing_errors"]
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    values["unscrewing_mean_deg_single"] = single["mean_deg"].mean()
    values["unscrewing_mean_deg_joint"] = joint["mean_deg"].item()
    values["unscrewing_end_deg_single"] = single["end_deg"].max()
    values["unscrewing_end_deg_joint"] = joint["end_deg"].item()
    for row in results["sequence_errors"].itertuples():
        values[f"scraping_{row.primitive}_mean_mm"] = row.mean_mm
        values[f"scraping_{row.primitive}_mean_deg"] = row.mean_deg
    for row in results.electrodes.itertuples():
        values[f"electrodes_{row.primitive}_median_nmse"] = row.nmse
        values[f"electrodes_{row.primitive}_median_rms_counts"] = row.rms
        values[f"electrodes_{row.primitive}_strong_mean_nmse"] = row.strong_nmse
    for row in results.slides.itertuples():
        values[f"slides_{row.group.replace(' ', '_')}_median_rms_counts"] = row.median_rms
    for material, trials in results["slide_left_one_out"].groupby("material"):
        values[f"slides_left_one_out_{material}_median_rms_counts"] = trials["rms"].median()
        values[f"slides_left_one_out_{material}_median_nmse"] = trials["nmse"].median()
    values["slides_clock_pose_rms_mm"] = (
        1e3 * results["clock_errors"].set_index("kind").loc["pose", "rms_error"]
    )
    return values | _avoidance_metrics(results) | _touch_metrics(results) | _panda_metrics(results)


def _panda_metrics(results: RecordedResults) -> Metrics:
    """Means over the joints."""
    means = results.panda.mean(axis=1)
    shown = (
        ("default", "urdf", "none"),
        ("least_squares_viscous", "least_squares", "viscous"),
        ("least_squares_coulomb", "least_squares", "coulomb"),
        ("cov_viscous", "cov", "viscous"),
        ("cov_coulomb", "cov", "coulomb"),
        ("mlp", "mlp", "none"),
    )
    return {f"panda_nmse_{name}": means[model, friction] for name, model, friction in shown}


def _correction_metrics(results: RecordedResults) -> Metrics:
    """Distances of the left-out higher reaches; their std is over the splits, differences are by reach."""
    distances, by_reach = results["coupling_distances"], results.distances_by_reach
    by_split = distances.groupby("split")[["nominal_mm", "coupling_mm", "spread_mm"]].mean()
    values: Metrics = {}
    for column, mean, std in (
        ("nominal_mm", "nominal_path_mean_mm", "nominal_path_std_mm"),
        ("coupling_mm", "coupling_path_mean_mm", "coupling_path_std_mm"),
        ("spread_mm", "corrected_spread_mm", "corrected_spread_std_mm"),
    ):
        values |= {mean: by_split[column].mean(), std: by_split[column].std()}
    for name, first, second in (
        ("coupling_gain", "nominal_mm", "coupling_mm"),
        ("coupling_above_spread", "coupling_mm", "spread_mm"),
    ):
        mean, half = mean_interval((by_reach[first] - by_reach[second]).to_numpy())
        values |= {f"{name}_mm": mean, f"{name}_half_width_mm": half}
    values["coupling_path_end_share"] = distances["end_share"].mean()
    for axis, its in results["coupling_scores"].groupby("axis"):
        values[f"coupling_{axis}_nmse"] = its["nmse"].mean()
    values["corrected_reaches_learned_from"] = int(distances["learned_from"].iloc[0])
    values["corrected_reaches_left_out"] = int((distances["split"] == 0).sum())
    return values


def by_axis(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """A column of a table of avoidance by `representation` and `inputs`, with a local axis per column."""
    keys = ["representation", "inputs"]
    return table.pivot_table(index=keys, columns="axis", values=column, sort=False)[AXES]


def best_representation(results: RecordedResults) -> tuple[str, str]:
    """Representation and what it sees of the smallest error on samples left out, averaged over the axes."""
    return by_axis(results["avoidance_scores"], "nmse").mean(axis=1).idxmin()


def _avoidance_metrics(results: RecordedResults) -> Metrics:
    """Of the best representation, and what the phase is worth to the ensemble."""
    worth = results["avoidance_phase"]
    best = by_axis(results["avoidance_scores"], "nmse").loc[best_representation(results)]
    gain, half = (by_axis(worth, column).loc["ensemble", "phase"] for column in ("gain", "half_width"))
    values: Metrics = {f"obstacle_nmse_{axis}": best[axis] for axis in AXES}
    for axis in AXES:
        values[f"obstacle_phase_gain_{axis}"] = gain[axis]
        values[f"obstacle_phase_gain_{axis}_half_width"] = half[axis]
    return values


def likeness(results: RecordedResults, first: str, second: str) -> float:
    """How alike the electrodes of two sets go together; NaN where a set has but one group."""
    its = results["touch_likeness"]
    return float(its.loc[(its["first"] == first) & (its["second"] == second), "correlation"].mean())


def _touch_metrics(results: RecordedResults) -> Metrics:
    """Of the structured latent space, and reconstruction by its rival."""
    spaces = results.touch_scores.xs("structured", level="model")
    scores, components = results.touch_scores["reconstruction"], "3 principal components"
    values: Metrics = {}
    for name, source in (("slides", "simulated, magnitudes"), ("unscrewing", "simulated")):
        own = spaces.loc[(name, name, "new trials")]
        carried = scores.loc[(source, name, "new set")]
        values |= {
            f"touch_reconstruction_nmse_{name}": own["reconstruction"],
            f"touch_mds_nmse_{name}": own["distances"],
            f"touch_pressure_nmse_{name}": own["pressure"],
            f"touch_components_nmse_{name}": scores[name, name, "new trials", components],
            f"touch_reconstruction_nmse_simulated_to_{name}": carried["structured"],
            f"touch_components_nmse_simulated_to_{name}": carried[components],
            f"touch_electrode_correlation_simulated_{name}": likeness(results, name, source),
        }
    new = spaces.loc[("slides", "slides", "new material")]
    return values | {"touch_reconstruction_nmse_new_material": new["reconstruction"]}
