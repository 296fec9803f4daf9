"""Reaches past boxes: what the stage wrote, and the numbers that follow."""

from functools import cached_property

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.reporting.scene_ways import NONE, OURS, PLANNED, TEXT, SceneWays
from structlearn.testbeds.recorded import names

AXES = ("x", "y", "z")

METRIC_WAYS = {
    "text_features": TEXT,
    "text_features_trained_our_way": "text_ensemble",
    "none": NONE,
    "planned": PLANNED,
    "human_inspired": "human_inspired",
}
"""By the end of a metric's name."""


class BoxesFound(SceneWays):
    """All that the pages show."""

    @cached_property
    def nmse(self) -> pd.DataFrame:
        """Held-out NMSE of the coupling term by way and axis, pooled over the folds."""
        pooled = self["errors"].groupby(["way", "axis"])[["squared", "variance"]].sum()
        return (pooled["squared"] / pooled["variance"]).unstack()[list(AXES)]  # noqa: PD010 - there is one value each

    @cached_property
    def summary(self) -> pd.DataFrame:
        """One row per way."""
        rows = []
        for way in self.ways:
            its, blocked = self.of(way), self.of(way, blocked=True)
            row: dict[str, str | float] = {"way": names.BOX_WAYS[way].name}
            row |= {"touches_share": its["hit"].mean(), "blocked_share": blocked["hit"].mean()}
            row |= {"goal_max_mm": its["left_mm"].max(), "path_mm": self.mean_path(way).value}
            row |= {"gaps_share": its["same_gaps"].mean()}
            row |= {"nearest_mm": its["clearance_mm"].min(), "wall_share": its["hit_wall"].mean()}
            rows.append(row)
        return pd.DataFrame(rows)


def boxes_metrics(found: BoxesFound) -> Metrics:
    """By name."""
    shares = {
        "boxes_hits": found.share("hit"),
        "boxes_hits_blocked": found.share("hit", blocked=True),
        "boxes_same_gap": found.share("same_gaps"),
        "boxes_path_mm": found.mean_path(),
        "boxes_path_mm_planned": found.mean_path(PLANNED),
        **{f"boxes_hits_{name}": found.share("hit", way) for name, way in METRIC_WAYS.items()},
    }
    values: Metrics = {"boxes_goal_max_mm": found.of(OURS)["left_mm"].max()}
    values["boxes_goal_median_mm"] = found.of(OURS)["left_mm"].median()
    for name, evidence in shares.items():
        values |= {name: evidence.value, f"{name}_low": evidence.low, f"{name}_high": evidence.high}
    values |= {f"boxes_nmse_{axis}": found.nmse.loc[OURS, axis] for axis in AXES}
    values["boxes_people_apart_mm"] = found["people"]["path_mm"].mean()
    its = found.of(OURS)
    values |= {"boxes_people": its["person"].nunique(), "boxes_reaches": len(its)}
    values |= {"boxes_blocked": int(its["blocked"].sum()), "boxes_left_out": len(found["left_out"])}
    return values
