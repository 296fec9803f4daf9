"""Page section on reaches past obstacles: models of some people, tested in the scenes of others."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from structlearn.avoidance.look_ahead import AHEAD_M
from structlearn.avoidance.scene_reaches import ONSET_SHARE
from structlearn.core.metrics import mean_interval
from structlearn.palette import DEMONSTRATION_COLOUR, GREY, LIGHT_GREY, SCENE_MODELS, Look
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence, clustered_share, mean, unknown
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import interval, rounded
from structlearn.tasks.obstacles.parameters import ObstacleParameters
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

# models of `learning`, repeated as text so that drawing need not import learning code
RECORDED, OURS, PUBLISHED, NONE, PLANNED = "recorded", "scene", "published", "none", "planned"
LOOKS = {RECORDED: Look("recorded", DEMONSTRATION_COLOUR)} | SCENE_MODELS
# line widths of the models drawn
WIDTHS = {RECORDED: 3.5, NONE: 1.0, PUBLISHED: 1.3, OURS: 1.8, PLANNED: 1.0}
TABLES = ("reaches", "errors", "people", "left_out", "paths", "shapes")  # of `SceneResults`
FIRST = 2  # number of path panels in view; the others are folded
FEWEST = 20  # number of reaches below which the page calls them few
AXES = ["x", "y", "z"]


class SceneWays(dict[str, pd.DataFrame]):
    """`TABLES` by name, with reaches selected by the model that moves the hand."""

    def __init__(self, tables: Mapping[str, pd.DataFrame]) -> None:
        super().__init__(tables)
        tried = set(self["reaches"]["model"])
        self.models = [model for model in SCENE_MODELS if model in tried]

    def of(self, model: str, blocked: bool = False) -> pd.DataFrame:
        """Reaches of one model; `blocked`: only those whose straight line meets an obstacle."""
        reaches = self["reaches"].query("model == @model")
        return reaches[reaches["blocked"]] if blocked else reaches

    def by_person(self, model: str, column: str) -> pd.Series:
        """Mean of a column by person."""
        return self.of(model).groupby("person")[column].mean()

    def share(self, column: str, model: str = OURS, blocked: bool = False) -> Evidence:
        """Share of the reaches of one model, with an interval clustered by person."""
        return clustered_share(*self.counts(column, model, blocked))

    def counts(self, column: str, model: str, blocked: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Hits (P,) and reaches (P,) by person."""
        people = self.of(model, blocked).groupby("person")[column]
        return people.sum().to_numpy(int), people.size().to_numpy()

    def hits_ratio(self, model: str, other: str) -> Evidence:
        """Ratio of the shares of reaches that touch an obstacle, with an interval over people.

        The ratio estimator: sum of one model's hits over that of the other; its variance is that of people's
        residuals, by the t distribution. Unknown without hits of the other, or with a single person.
        """
        hits, others = (self.counts("hit", name)[0] for name in (model, other))
        if not others.any() or len(hits) < 2:
            return unknown("the other model touches nothing, or one person does not show how people differ")
        ratio = hits.sum() / others.sum()
        _, half = mean_interval((hits - ratio * others) / others.mean())
        return Evidence(ratio, max(ratio - half, 0.0), ratio + half, len(hits))


def sections(files: TaskFiles) -> list[Section]:
    """The section on reaches past obstacles."""
    results = SceneWays({name: files.table(f"obstacles/{name}") for name in TABLES})
    find, people = scene_findings(results), results["people"]
    named = all(results["reaches"]["person"] != results["reaches"]["reach"])
    facts = {
        "find": find,
        "who": "people" if named else "recordings",
        "folds": results["reaches"]["fold"].nunique(),
        "pictured": results["paths"]["reach"].nunique(),
        "first": FIRST,
        "fewest": FEWEST,
        "pairs": len(people),
        "alike": people["same_gaps"].mean(),
        "ahead_m": AHEAD_M,
        "onset_share": ONSET_SHARE,
        "chosen": files.entry(ObstacleParameters),
    }
    section = Section(
        "obstacles",
        "Reaches past obstacles",
        "scene.html.jinja",
        lead="scene_lead.html.jinja",
        facts=facts | find.numbers(),
        find=find,
        tables=scene_tables(results),
        pictures=scene_pictures(results),
    )
    return [section]


def scene_findings(results: SceneWays) -> Findings:
    """Findings, by the names that claims and sentences use."""
    reaches, apart = results.of(OURS), results["people"]["path_mm"]
    people = reaches["person"].nunique()
    find = Findings(f"reaches of {people} people left out in turn")
    find.add("hits", results.share("hit"), headline=True)
    find.add("hits_blocked", results.share("hit", blocked=True))
    for model in results.models:
        if model != OURS:
            find.add(f"{model}_hits", results.share("hit", model), headline=model == PUBLISHED)
    for name, *pair in (
        ("published_hits_fewer_than_rai", "human_inspired", PUBLISHED),
        ("features_alone", "nearest", OURS),
    ):
        find.rate_difference(name, *(results.counts("hit", model) for model in pair), unit="%")
    find.add("published_hits_ratio", results.hits_ratio(PUBLISHED, NONE))
    find.exact("goal", reaches["left_mm"].max(), len(reaches), unit="mm")
    find.exact("published_goal", results.of(PUBLISHED)["left_mm"].max(), len(reaches), unit="mm")
    ours, planned = (results.by_person(model, "path_mm") for model in (OURS, PLANNED))
    find.mean("path", ours, unit="mm", headline=True)
    find.mean("planned_path", planned, unit="mm")
    find.difference("nearer_than_planned", planned, ours, unit="mm")
    find.add("same_gap", results.share("same_gaps"))
    if len(apart):
        find.exact("people_apart", apart.mean(), len(apart), unit="mm")
    find.exact("people", people)
    find.exact("reaches", len(reaches))
    find.exact("blocked", reaches["blocked"].sum())
    find.exact("left_out", len(results["left_out"]))
    return find


def scene_tables(results: SceneWays) -> dict[str, Table]:
    """Tables by name."""
    rows = []
    for model in results.models:
        reaches, hit = results.of(model), results.share("hit", model)
        path = mean(results.by_person(model, "path_mm").to_numpy())
        apart = f"{rounded(path.value, '.1f')} {interval(max(path.low, 0.0), path.high)}"
        rows.append(
            {
                "model": LOOKS[model].name,
                "touches (%)": f"{100 * hit.value:.1f} {interval(100 * hit.low, 100 * hit.high)}",
                "of blocked (%)": 100 * results.of(model, blocked=True)["hit"].mean(),
                "goal, largest (mm)": reaches["left_mm"].max(),
                "distance of paths (mm)": apart,
                "same gaps (%)": 100 * reaches["same_gaps"].mean(),
                "nearest (mm)": reaches["clearance_mm"].min(),
                "wall (%)": 100 * reaches["hit_wall"].mean(),
            }
        )
    formats = dict.fromkeys(("of blocked (%)", "same gaps (%)", "wall (%)"), ".1f")
    formats |= dict.fromkeys(("goal, largest (mm)", "nearest (mm)"), ".0f")
    by_person = results.of(OURS).groupby("person", as_index=False)
    people = by_person.agg(
        reaches=("hit", "size"),
        blocked=("blocked", "sum"),
        touching=("hit", "sum"),
        path_mm=("path_mm", "mean"),
        goal_max_mm=("left_mm", "max"),
        other_gaps=("same_gaps", lambda same: int((~same).sum())),
    )
    pooled = results["errors"].groupby(["model", "axis"], as_index=False)[["squared", "variance"]].sum()
    nmse = pooled.assign(nmse=pooled["squared"] / pooled["variance"])
    learned = [model for model in results.models if model in set(nmse["model"])]
    errors = nmse.pivot_table("nmse", "model", "axis").loc[learned, AXES]
    errors = errors.rename(index={model: look.name for model, look in LOOKS.items()}).reset_index(
        names="model"
    )
    headings = {
        "path_mm": "from the recorded path (mm)",
        "goal_max_mm": "goal, largest (mm)",
        "other_gaps": "other gaps",
    }
    return {
        "obstacles_ways": Table(pd.DataFrame(rows), formats, strong=frozenset({results.models.index(OURS)})),
        "obstacles_errors": Table(errors, dict.fromkeys(AXES, ".2f")),
        "obstacles_by_person": Table(people, {"path_mm": ".1f", "goal_max_mm": ".0f"}, headings),
        "obstacles_left_out": Table(results["left_out"]),
        "obstacles_reaches": Table(results["reaches"]),
        "obstacles_beside_each_other": Table(results["people"]),
    }


def scene_pictures(results: SceneWays) -> dict[str, list[Drawing]]:
    """Figures by name."""
    paths: list[Drawing] = [paths_panel(results, reach) for reach in results["paths"]["reach"].unique()]
    pictures: dict[str, list[Drawing]] = {
        "obstacles_rates": [rates_panel(results), path_distance_panel(results)]
    }
    pictures |= {"obstacles_paths": paths[:FIRST], "obstacles_more_paths": paths[FIRST:]}
    return {name: drawings for name, drawings in pictures.items() if drawings}


@styled
def paths_panel(results: SceneWays, reach: str) -> Figure:
    """One reach from above: obstacles, walls (pale), the recorded path and the models' paths."""
    title = f"From above: {reach.replace('_', ' ')}"
    figure, axes = panel(title, 4.6, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    for row in results["shapes"].query("reach == @reach").itertuples():
        corner = (1e3 * (row.x_m - 0.5 * row.width_m), 1e3 * (row.y_m - 0.5 * row.depth_m))
        size, colour = (1e3 * row.width_m, 1e3 * row.depth_m), GREY if row.box else LIGHT_GREY
        axes.add_patch(Rectangle(corner, *size, color=colour, linewidth=0))
    paths = results["paths"].query("reach == @reach")
    for model, width in WIDTHS.items():
        path, look = paths[paths["model"] == model], LOOKS[model]
        style: dict[str, Any] = {"color": look.colour, "linewidth": width, "label": look.name}
        axes.plot(1e3 * path["x_m"], 1e3 * path["y_m"], "--" if model == NONE else "-", **style)
    ends = paths[paths["model"] == RECORDED].iloc[[0, -1]]
    axes.plot(1e3 * ends["x_m"], 1e3 * ends["y_m"], "o", color="black", markersize=4)
    axes.margins(0.05)
    return legend(figure)


@styled
def rates_panel(results: SceneWays) -> Figure:
    """Share of reaches that touch an obstacle, among all reaches and among blocked ones."""
    figure, axes = panel("Reaches that touch an obstacle", 3.6, xlabel="share (%)")
    groups = (-0.15, "all reaches", False, "full"), (0.15, "blocked ones", True, "none")
    for offset, label, blocked, fill in groups:
        for place, model in enumerate(results.models):
            rate = results.share("hit", model, blocked)
            bars = 100 * np.array([[rate.value - rate.low], [rate.high - rate.value]])
            style: dict[str, Any] = {"color": LOOKS[model].colour, "fillstyle": fill, "markersize": 5}
            axes.errorbar(100 * rate.value, place + offset, xerr=bars, fmt="o", **style)
        axes.plot([], [], "o", color=GREY, fillstyle=fill, label=label)
    _name_ways(results, axes)
    axes.set_xlim(-2, 102)
    return legend(figure)


@styled
def path_distance_panel(results: SceneWays) -> Figure:
    """Distance from recorded paths: a stroke per person, a dot for the mean; dashed: between two people."""
    figure, axes = panel("Distance from the recorded path", 3.6, xlabel="mean of a person (mm)")
    for place, model in enumerate(results.models):
        means, colour = results.by_person(model, "path_mm"), LOOKS[model].colour
        axes.plot(means, np.full(len(means), place), "|", color=colour, markersize=11)
        axes.plot(means.mean(), place, "o", color=colour, markersize=5)
    if len(results["people"]):
        apart = results["people"]["path_mm"].mean()
        axes.axvline(apart, color=GREY, linestyle="--", linewidth=1.0, label="two people in one scene")
    _name_ways(results, axes)
    axes.set_xlim(left=0.0)
    return legend(figure) if len(results["people"]) else figure


def _name_ways(results: SceneWays, axes: Any) -> None:
    """Label the vertical axis with all models from top to bottom."""
    labels = [LOOKS[model].name.replace(" (", "\n(").replace(", ", ",\n") for model in results.models]
    axes.set_yticks(range(len(labels)), labels)
    axes.grid(axis="y", visible=False)
    axes.invert_yaxis()
