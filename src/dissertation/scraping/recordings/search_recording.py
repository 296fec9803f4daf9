"""Recording of the policy search in refinement (IV.7): rollouts of each iteration, and their costs.

Each step of the time line is an iteration. Its network is the one before the next update (iteration 0: before
any); the policies of an iteration are drawn around what the previous iteration's network did.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dissertation.scraping.names import ROLLOUTS
from structlearn.palette import BAD, WHITE
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.viewer import views
from structlearn.viewer.diagram import Diagram, axes, diagram_view, rounded_range
from structlearn.viewer.items import TIME, Item, blended, dots, entity, lines, texts, thinning
from structlearn.viewer.views import Panel

ITERATION, ITERATION_S = "iteration", 1.0
"""Time line with one step per iteration, and a step's length on the time line of seconds."""

CHEAP, COSTLY = WHITE, "#4a4f57"
"""Ends of the colour scale of drawn policies, by accumulated cost."""

COSTLY_QUANTILE = 0.9
"""Share of the drawn policies within the colour scale; single failures would make all others look cheap."""

LEGEND = {
    f"{ROLLOUTS[SAMPLE].name}, cheap": CHEAP,
    "costly": COSTLY,
    ROLLOUTS[IMPROVED].name: ROLLOUTS[IMPROVED].colour,
    f"{ROLLOUTS[FEEDBACK].name} (pale: before)": ROLLOUTS[FEEDBACK].colour,
}
"""Legend above the coupling terms: names and colours."""

PLACES = {SAMPLE: (-0.24, 0.16), IMPROVED: (0.08, 0.06), FEEDBACK: (0.3, 0.06)}
"""Centre and half-width of an iteration's rollouts on the iteration axis, relative to its number."""

LABELS = {SAMPLE: (-1.5, -0.5), IMPROVED: (-0.3, 0.4), FEEDBACK: (0.3, -1.9)}
"""Offsets of the labels of means from their points in the drawing: beside, below and above."""

WIDTH, HEIGHTS = 32.0, {"target": 14.0, "cost_rad": 8.0}
"""Sizes of the diagrams over time in drawing units, by column of the samples."""

CURVE_RATE_HZ = 50.0  # points per second of a curve; curves take up most of a search's file
ON_TOP = 40.0  # draw order above rerun's defaults for lines and points, 20 and 30
PALE = 0.4  # opacity of the rollouts of other iterations


@dataclass(frozen=True)
class Search:
    """Rollouts of the policy search for one primitive."""

    primitive: str
    history: pd.DataFrame  # of `refinement.history_rows`
    samples: pd.DataFrame  # of `refinement.sample_rows`

    @property
    def iterations(self) -> list[int]:
        """Iterations in order, from 0."""
        return sorted(self.history["iteration"].unique())

    @property
    def cost_range(self) -> tuple[float, float]:
        """Accumulated costs in rad at the ends of the colour scale."""
        costs = self.history.loc[self.history["kind"] == SAMPLE, "cost_rad"].dropna()
        return (costs.min(), costs.quantile(COSTLY_QUANTILE)) if len(costs) else (0.0, 1.0)

    def path(self, *parts: str) -> str:
        """Path of one of this search's entities."""
        return entity("search", self.primitive, *parts)

    def rows(self, iteration: int, kind: str) -> pd.DataFrame:
        """Successful rollouts of the history."""
        own = (self.history["iteration"] == iteration) & (self.history["kind"] == kind)
        return self.history[own & self.history["cost_rad"].notna()]

    def curves(self, iteration: int, kind: str, column: str) -> pd.DataFrame:
        """A column of the samples over time, (T, K): index `time_s`, one column per rollout number."""
        own = self.samples[(self.samples["iteration"] == iteration) & (self.samples["kind"] == kind)]
        return own.pivot_table(index="time_s", columns="number", values=column)


def searches(history: pd.DataFrame, samples: pd.DataFrame) -> list[Search]:
    """Split tables with a column `primitive` into one search per primitive, in order of refinement."""
    return [
        Search(name, own, samples[samples["primitive"] == name])
        for name, own in history.groupby("primitive", sort=False)
    ]


def search_tab(search: Search, origin: str) -> Panel:
    """Tab of a search on the time lines of iterations and seconds; `origin`: of `views.origin_label`."""
    headings = {
        "target": f"coupling term of every rollout (rad){origin}; step on the time line '{ITERATION}'",
        "cost_rad": f"cost of every rollout: tool off its nominal orientation (rad){origin}",
    }
    curves = []
    for name, height in HEIGHTS.items():
        values = rounded_range(search.samples[name].to_numpy(), 0.0 if name == "cost_rad" else None)
        diagram = Diagram((0.0, float(search.samples["time_s"].max())), values, WIDTH, height)
        shown = axes(search.path(name, "axes"), diagram, "time (s)")
        if name == "target":
            places = [[(0.5 + place) * WIDTH / len(LEGEND), -1.5] for place in range(len(LEGEND))]
            shown.append(texts(search.path(name, "legend"), places, list(LEGEND), list(LEGEND.values())))
        for iteration in search.iterations:
            shown += _curves(search, name, diagram, iteration)
        curves.append(diagram_view(f"{search.primitive}: {headings[name]}", shown, diagram))
    ends = (search.iterations[0] - 0.6, search.iterations[-1] + 0.6)
    summed = Diagram(ends, rounded_range(search.history["cost_rad"].dropna().to_numpy(), 0.0), 20.0, 25.0)
    shown = axes(search.path("costs", "axes"), summed, "iteration", search.iterations)
    shown += [*_all_costs(search, summed)]
    for iteration in search.iterations:
        shown += _costs(search, summed, iteration)
    costs = diagram_view(f"accumulated cost of every rollout (rad; numbers: means){origin}", shown, summed)
    name = f"search: {search.primitive}"
    return views.row(views.column(*curves, shares=[3, 2]), costs, shares=[3, 2], name=name)


def _at(iteration: int) -> dict[str, float]:
    return {ITERATION: int(iteration), TIME: float(ITERATION_S * iteration)}


def cost_colours(costs: np.ndarray, cost_range: tuple[float, float]) -> np.ndarray:
    """Colours 0xRRGGBBAA (K,) of accumulated costs (K,) in rad; cheaper is brighter."""
    low, high = cost_range
    return blended((costs - low) / max(high - low, np.finfo(float).tiny), (CHEAP, COSTLY))


def _curves(search: Search, column: str, diagram: Diagram, iteration: int) -> Iterator[Item]:
    """The drawn policies and, thick, the improved one, the network, and pale the network before."""
    tried, at = (
        search.rows(iteration, SAMPLE).sort_values("cost_rad", ascending=False, kind="stable"),
        _at(iteration),
    )
    if len(tried):  # the cheapest on top
        strips = _strips(search.curves(iteration, SAMPLE, column)[tried["number"]], diagram)
        colours = cost_colours(tried["cost_rad"].to_numpy(), search.cost_range)
        yield lines(search.path(column, SAMPLE), strips, colours, -0.8, at=at)
    before, now = (iteration - 1, FEEDBACK, 0.5), (iteration, FEEDBACK, 1.0)
    means = {"network before": before, IMPROVED: (iteration, IMPROVED, 1.0), FEEDBACK: now}
    for order, (name, (of, kind, opacity)) in enumerate(means.items(), start=1):
        if len(search.rows(of, kind)):
            strips = _strips(search.curves(of, kind, column).mean(axis=1).to_frame(), diagram)
            look = {"opacity": opacity, "draw_order": ON_TOP + order}
            yield lines(search.path(column, name), strips, ROLLOUTS[kind].colour, -1.6, at=at, **look)


def _strips(curves: pd.DataFrame, diagram: Diagram) -> list[np.ndarray]:
    """Thinned curves over `time_s`, as strips of a diagram."""
    thinned = curves.iloc[:: thinning(float(np.median(np.diff(curves.index))), CURVE_RATE_HZ)]
    known = [thinned[number].dropna() for number in thinned]
    return [diagram.points(one.index.to_numpy(), one.to_numpy()) for one in known]


def _cost_points(search: Search, diagram: Diagram, iteration: int, kind: str) -> np.ndarray:
    """Points of the rollouts of a kind, spread in order of their numbers."""
    costs = search.rows(iteration, kind)["cost_rad"].to_numpy()
    across = np.linspace(-1.0, 1.0, len(costs)) if len(costs) > 1 else np.zeros(len(costs))
    middle, half_width = PLACES[kind]
    return diagram.points(iteration + middle + half_width * across, costs)


def _all_costs(search: Search, diagram: Diagram) -> Iterator[Item]:
    """All rollouts pale, and the mean of the network over iterations."""
    for kind, look in ROLLOUTS.items():
        points = np.concatenate([_cost_points(search, diagram, one, kind) for one in search.iterations])
        yield dots(search.path("costs", "all", kind), points, look.colour, -2.5, PALE, draw_order=-3.0)
    means = [search.rows(iteration, FEEDBACK)["cost_rad"].mean() for iteration in search.iterations]
    line = diagram.points(np.array(search.iterations) + PLACES[FEEDBACK][0], np.array(means))
    colour = ROLLOUTS[FEEDBACK].colour
    yield lines(search.path("costs", "network mean"), [line], colour, -1.0, 2 * PALE, draw_order=-2.0)


def _costs(search: Search, diagram: Diagram, iteration: int) -> Iterator[Item]:
    """The rollouts of this iteration with the mean of each kind, and the number of failures."""
    at = _at(iteration)
    for kind, look in ROLLOUTS.items():
        costs = search.rows(iteration, kind)["cost_rad"].to_numpy()
        if len(costs):
            colours = cost_colours(costs, search.cost_range) if kind == SAMPLE else look.colour
            points = _cost_points(search, diagram, iteration, kind)
            yield dots(search.path("costs", kind), points, colours, -3.5, at=at)
            place = diagram.points(iteration + PLACES[kind][0], costs.mean()) + LABELS[kind]
            mean = [f"{costs.mean():.1f}"]
            yield texts(search.path("costs", kind, "mean"), place, mean, look.colour, at=at)
    failed = search.history["cost_rad"].isna()
    if failed.any():
        now = int(failed[search.history["iteration"] == iteration].sum())
        place = diagram.points(iteration, diagram.y_range[1])
        label = [f"{now} failed"] * (now > 0)
        yield texts(search.path("costs", "failed"), [place] * (now > 0), label, BAD, at=at)
