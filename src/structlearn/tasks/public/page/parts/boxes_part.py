"""People past boxes: one obstacle's features, and a look ahead at the whole scene."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.palette import GREY, LIGHT_GREY
from structlearn.reporting.claims import Evidence, Found, difference, exact, rate_difference
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import Drawing, styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.scene_ways import NONE, OURS, PLANNED, RECORDED, TEXT, SceneWays
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.avoidance_part import listed
from structlearn.tasks.public.page.parts.part import Part, of
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown
from structlearn.tasks.public.public_files import SETS

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
            row: dict[str, str | float] = {"way": public_names.BOX_WAYS[way].name}
            row |= {"touches_share": its["hit"].mean(), "blocked_share": blocked["hit"].mean()}
            row |= {"goal_max_mm": its["left_mm"].max(), "path_mm": self.mean_path(way).value}
            row |= {"gaps_share": its["same_gaps"].mean()}
            row |= {"nearest_mm": its["clearance_mm"].min(), "wall_share": its["hit_wall"].mean()}
            rows.append(row)
        return pd.DataFrame(rows)


def boxes_metrics(found: BoxesFound) -> Metrics:
    """Metrics keyed by name."""
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


FIRST = 2
"""Panels of the picture at the top; the others stand in a fold."""


def boxes_pictures(found: BoxesFound) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name."""
    made: dict[str, Drawing | Sequence[Drawing]] = {
        "boxes_rates": [rates_panel(found), distance_panel(found)]
    }
    panels = [paths_panel(found, reach) for reach in found["paths"]["reach"].unique()]
    if panels:
        made |= {"boxes_paths": panels[:FIRST], "boxes_more_paths": panels[FIRST:]}
    return made


@styled
def paths_panel(found: BoxesFound, reach: str) -> Figure:
    """One reach from above: boxes, the person's path and those of ways that had never seen the person."""
    title = f"From above: {reach.replace('_', ' ')}"
    figure, axes = panel(title, 4.6, xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal")
    found.draw_paths(axes, reach, public_names.BOX_WAYS[RECORDED]._replace(colour=LIGHT_GREY))
    ends = found["paths"].query("reach == @reach and way == @RECORDED").iloc[[0, -1]]
    axes.plot(1e3 * ends["x_m"], 1e3 * ends["y_m"], "o", color="black", markersize=4)
    axes.set(xlim=(-380, 380), ylim=(-330, 270))
    return legend(figure)


@styled
def rates_panel(found: BoxesFound) -> Figure:
    """Share of reaches that touch a box, over all reaches and over the blocked ones."""
    figure, axes = panel("Reaches that touch a box", 3.6, xlabel="share (%)")
    for offset, (label, blocked, fill) in enumerate(
        (("all reaches", False, "full"), ("blocked ones", True, "none"))
    ):
        for place, way in enumerate(found.ways):
            rate = found.share("hit", way, blocked)
            bars = 100 * np.array([[rate.value - rate.low], [rate.high - rate.value]])
            style: dict[str, Any] = {
                "color": public_names.BOX_WAYS[way].colour,
                "fillstyle": fill,
                "markersize": 5,
            }
            axes.errorbar(100 * rate.value, place + 0.3 * offset - 0.15, xerr=bars, fmt="o", **style)
        axes.plot([], [], "o", color=GREY, fillstyle=fill, label=label)
    found.name_ways(axes)
    axes.set_xlim(-2, 102)
    return legend(figure)


@styled
def distance_panel(found: BoxesFound) -> Figure:
    """Distance from people's own paths, one point per person; a line where two people are apart."""
    figure, axes = panel("Distance from the person's path", 3.6, xlabel="mean of a person (mm)")
    found.draw_distances(axes)
    if len(found["people"]):
        apart = found["people"]["path_mm"].mean()
        axes.axvline(apart, color=GREY, linestyle="--", linewidth=1.0, label="two people in one scene")
    found.name_ways(axes)
    axes.set_xlim(left=0.0)
    return legend(figure) if len(found["people"]) else figure


KEY = "recorded_boxes"


def found_of(results: RecordedResults) -> BoxesFound:
    """Output of the stage."""
    return BoxesFound(results.of_set("boxes_"))


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences, under one name."""
    found = found_of(results)
    return {
        "boxes": {
            "found": found,
            "chosen": results.parameters[KEY],
            "errors_of": lambda way: listed(found.nmse.loc[way]),
        }
    }


def boxes_tables(found: BoxesFound) -> dict[str, Table]:
    """Tables keyed by name."""
    strong = frozenset({found.ways.index(OURS)})
    formats = {"path_mm": ".1f", "goal_max_mm": ".0f", "nearest_mm": ".0f"}
    models = [way for way in found.ways if way in found.nmse.index]
    errors = found.nmse.loc[models].reset_index()
    errors["way"] = [public_names.BOX_WAYS[way].name for way in models]
    people = found.of(OURS).groupby("person", as_index=False)
    by_person = people.agg(
        reaches=("hit", "size"),
        blocked=("blocked", "sum"),
        touching=("hit", "sum"),
        path_mm=("path_mm", "mean"),
        goal_max_mm=("left_mm", "max"),
        other_gaps=("same_gaps", lambda same: int((~same).sum())),
    )
    return {
        "boxes_ways": shown(found.summary, strong, **formats),
        "boxes_errors": shown(errors, **dict.fromkeys(AXES, ".2f")),
        "boxes_by_person": shown(by_person, path_mm=".1f", goal_max_mm=".0f"),
        "boxes_left_out": Table(found["left_out"]),
        "boxes_reaches": Table(found["reaches"]),
        "boxes_beside_each_other": Table(found["people"]),
    }


def boxes_evidence(found: SceneWays) -> dict[str, Found]:
    """What was found, by the names that `boxes_claims.yaml` uses."""
    return {
        "text_hits": found.share("hit", TEXT),
        "text_hits_fewer": fewer(found, NONE, TEXT),
        "text_hits_fewer_than_rai": fewer(found, "human_inspired", TEXT),
        "text_goal": furthest(found, TEXT),
        "hits": found.share("hit"),
        "hits_blocked": found.share("hit", blocked=True),
        "goal": furthest(found, OURS),
        "path": found.mean_path(),
        "same_gap": found.share("same_gaps"),
        "features_alone": fewer(found, "text_ensemble", OURS),
        "nearer_than_planned": difference(*(found.by_person(way, "path_mm") for way in (PLANNED, OURS))),
    }


def fewer(found: SceneWays, first: str, second: str) -> Evidence:
    """Reaches that touch a box by the first way minus those by the second, in %, in pairs by person."""
    return rate_difference(*(found.by_person(way, "hit") for way in (first, second)))


def furthest(found: SceneWays, way: str) -> Evidence:
    """Largest distance from the goal at the prescribed end, mm."""
    left = found.of(way)["left_mm"]
    return exact(left.max(), len(left))


PART = Part(
    name="boxes",
    heading="People past boxes",
    page="boxes",
    needs=tuple(f"boxes_{table}" for table in SETS["boxes"]),
    parameters=(KEY,),
    metrics=of(found_of, boxes_metrics),
    evidence=of(found_of, boxes_evidence),
    facts=facts,
    tables=of(found_of, boxes_tables),
    pictures=of(found_of, boxes_pictures),
)
