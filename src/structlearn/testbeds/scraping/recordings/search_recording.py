"""The policy search of a refinement in recordings (IV.7): what was tried in each iteration, and what it cost.

A step of the time line is an iteration. Its network is that before the next update, iteration 0 that before
any; the policies of an iteration are drawn around what the network of the iteration before had done.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import GREEN, ORANGE, SKY, VERMILION
from structlearn.policy_search.rollouts import FEEDBACK, IMPROVED, SAMPLE
from structlearn.viewer.diagram import Diagram, diagram_view, rounded_range, send_axes, texts
from structlearn.viewer.rrd import TIME, blended, entity, rgba, thinning

ITERATION = "iteration"
"""Time line on which each step is another iteration."""

ITERATION_S = 1.0
"""Of an iteration on the time line of seconds, so that the search is seen on that one too."""

CHEAP, COSTLY = GREEN, "#8a5470"
"""Ends of the colours of sampled policies, by accumulated cost."""

COSTLY_QUANTILE = 0.9
"""Share of the sampled policies within the colours: single failures would make all others look cheap."""

COLOURS = {SAMPLE: GREEN, IMPROVED: ORANGE, FEEDBACK: SKY}

LEGEND = {
    "sampled policy, cheap": CHEAP,
    "costly": COSTLY,
    "improved policy": ORANGE,
    "network (pale: before)": SKY,
}
"""Names and colours, above the coupling terms."""

ON_TOP = 40.0
"""Draw order above rerun's own for lines and points, 20 and 30."""

PLACES = {SAMPLE: -0.24, IMPROVED: 0.08, FEEDBACK: 0.3}
"""Where the rollouts of an iteration stand beside each other, in iterations from its number."""

LABELS = {SAMPLE: (-1.5, -0.5), IMPROVED: (-0.3, 0.4), FEEDBACK: (0.3, -1.9)}
"""Where the means are written, from their points in the drawing: beside, below and above the points."""

SPREAD = {SAMPLE: 0.16, IMPROVED: 0.06, FEEDBACK: 0.06}
"""Half width of each."""

WIDTH, HEIGHTS = 32.0, {"target": 14.0, "cost_rad": 8.0}
"""Of the diagrams over time in their drawings, by column of the samples."""

CURVE_RATE_HZ = 50.0
"""Points per second of a curve: they are the most that a search takes of a file."""

PALE = 0.4
"""Opacity of the rollouts of other iterations."""


@dataclass(frozen=True)
class Search:
    """Rollouts of the search for one primitive.

    Attributes:
        primitive: its name.
        history: one row per rollout, see `policy_search.rollouts.history_rows`.
        samples: what was felt and done, see `policy_search.rollouts.sample_rows`.
    """

    primitive: str
    history: pd.DataFrame
    samples: pd.DataFrame

    @property
    def iterations(self) -> list[int]:
        """In their order, from 0."""
        return sorted(self.history["iteration"].unique())

    @property
    def cost_range(self) -> tuple[float, float]:
        """Accumulated costs in rad that get the ends of the colours."""
        costs = self.history.loc[self.history["kind"] == SAMPLE, "cost_rad"].dropna()
        return (costs.min(), costs.quantile(COSTLY_QUANTILE)) if len(costs) else (0.0, 1.0)

    def rows(self, iteration: int, kind: str) -> pd.DataFrame:
        """Of the history, rollouts that did not fail."""
        own = (self.history["iteration"] == iteration) & (self.history["kind"] == kind)
        return self.history[own & self.history["cost_rad"].notna()]

    def curves(self, iteration: int, kind: str, column: str) -> pd.DataFrame:
        """A column of the samples over time, (T, K): index `time_s`, one column per rollout's number."""
        own = self.samples[(self.samples["iteration"] == iteration) & (self.samples["kind"] == kind)]
        return own.pivot_table(index="time_s", columns="number", values=column)


def searches(history: pd.DataFrame, samples: pd.DataFrame) -> list[Search]:
    """One search per primitive, in the order in which they were refined.

    Args:
        history: rows of `policy_search.rollouts.history_rows` with `primitive`.
        samples: rows of `policy_search.rollouts.sample_rows` with `primitive`.
    """
    return [
        Search(name, own, samples[samples["primitive"] == name])
        for name, own in history.groupby("primitive", sort=False)
    ]


def send_search(stream: rr.RecordingStream, search: Search) -> None:
    """Log the search for a primitive, on the time lines of iterations and of seconds."""
    costs = _cost_diagram(search)
    send_axes(stream, _path(search, "costs", "axes"), costs, "iteration", search.iterations)
    _send_all_costs(stream, search, costs)
    for column in HEIGHTS:
        send_axes(stream, _path(search, column, "axes"), _curve_diagram(search, column), "time (s)")
    _send_legend(stream, search)
    for iteration in search.iterations:
        stream.set_time(ITERATION, sequence=iteration)
        stream.set_time(TIME, duration=ITERATION_S * iteration)
        _send_costs(stream, search, costs, iteration)
        for column in HEIGHTS:
            _send_curves(stream, search, column, iteration)
    stream.reset_time()


def search_tab(search: Search, origin: str) -> rrb.Horizontal:
    """Tab of what `send_search` logs.

    Args:
        search: for one primitive.
        origin: of `recording.origin_label`.
    """
    headings = {
        "target": f"coupling term of every rollout{origin}; step on the time line '{ITERATION}'",
        "cost_rad": f"cost of every rollout: tool off its nominal orientation (rad){origin}",
    }
    curves = [
        diagram_view(f"{search.primitive}: {heading}", _path(search, column), _curve_diagram(search, column))
        for column, heading in headings.items()
    ]
    costs = diagram_view(
        f"accumulated cost of every rollout (rad; numbers: means){origin}",
        _path(search, "costs"),
        _cost_diagram(search),
    )
    return rrb.Horizontal(
        rrb.Vertical(*curves, row_shares=[3, 2]),
        costs,
        column_shares=[3, 2],
        name=f"search: {search.primitive}",
    )


def cost_colours(costs: np.ndarray, cost_range: tuple[float, float]) -> np.ndarray:
    """Colours 0xRRGGBBAA (K,) of accumulated costs (K,) in rad: the cheaper the brighter."""
    low, high = cost_range
    return blended((costs - low) / max(high - low, np.finfo(float).tiny), (CHEAP, COSTLY))


def _path(search: Search, *parts: str) -> str:
    return entity("search", search.primitive, *parts)


def _curve_diagram(search: Search, column: str) -> Diagram:
    least = 0.0 if column == "cost_rad" else None
    times = (0.0, float(search.samples["time_s"].max()))
    values = rounded_range(search.samples[column].to_numpy(), least)
    return Diagram(times, values, WIDTH, HEIGHTS[column])


def _cost_diagram(search: Search) -> Diagram:
    first, last = search.iterations[0], search.iterations[-1]
    costs = search.history["cost_rad"].dropna().to_numpy()
    return Diagram((first - 0.6, last + 0.6), rounded_range(costs, 0.0), 20.0, 25.0)


def _send_legend(stream: rr.RecordingStream, search: Search) -> None:
    places = [[(0.5 + place) * WIDTH / len(LEGEND), -1.5] for place in range(len(LEGEND))]
    stream.log(_path(search, "target", "legend"), texts(places, LEGEND, LEGEND.values()), static=True)


def _send_curves(stream: rr.RecordingStream, search: Search, column: str, iteration: int) -> None:
    """Sampled policies, and thick the improved one, the network, and pale the network before."""
    diagram = _curve_diagram(search, column)
    tried = search.rows(iteration, SAMPLE).sort_values("cost_rad", ascending=False)  # the cheapest on top
    if len(tried):
        curves = search.curves(iteration, SAMPLE, column)[tried["number"]]
        colours = cost_colours(tried["cost_rad"].to_numpy(), search.cost_range)
        lines = rr.LineStrips2D(_strips(curves, diagram), colors=colours, radii=-0.8)
        stream.log(_path(search, column, SAMPLE), lines)
    means = {"network before": (iteration - 1, FEEDBACK), IMPROVED: (iteration, IMPROVED)}
    means[FEEDBACK] = (iteration, FEEDBACK)
    for order, (name, (of, kind)) in enumerate(means.items()):
        if len(search.rows(of, kind)):
            mean = search.curves(of, kind, column).mean(axis=1).to_frame()
            colour = rgba([COLOURS[kind]], 1.0 if of == iteration else 0.5)
            line = rr.LineStrips2D(
                _strips(mean, diagram), colors=colour, radii=-1.6, draw_order=ON_TOP + order
            )
            stream.log(_path(search, column, name), line)


def _strips(curves: pd.DataFrame, diagram: Diagram) -> list[np.ndarray]:
    """Curves over `time_s`, thinned, as strips of a diagram."""
    thinned = curves.iloc[:: thinning(float(np.median(np.diff(curves.index))), CURVE_RATE_HZ)]
    known = [thinned[number].dropna() for number in thinned]
    return [diagram.points(one.index.to_numpy(), one.to_numpy()) for one in known]


def _cost_points(search: Search, diagram: Diagram, iteration: int, kind: str) -> np.ndarray:
    """Rollouts of a kind beside each other, in the order of their numbers."""
    costs = search.rows(iteration, kind)["cost_rad"].to_numpy()
    across = np.linspace(-1.0, 1.0, len(costs)) if len(costs) > 1 else np.zeros(len(costs))
    return diagram.points(iteration + PLACES[kind] + SPREAD[kind] * across, costs)


def _send_all_costs(stream: rr.RecordingStream, search: Search, diagram: Diagram) -> None:
    """All rollouts pale, and the mean of the network over iterations."""
    for kind, colour in COLOURS.items():
        points = [_cost_points(search, diagram, iteration, kind) for iteration in search.iterations]
        dots = rr.Points2D(np.concatenate(points), colors=rgba([colour], PALE), radii=-2.5, draw_order=-3.0)
        stream.log(_path(search, "costs", "all", kind), dots, static=True)
    means = [search.rows(iteration, FEEDBACK)["cost_rad"].mean() for iteration in search.iterations]
    line = diagram.points(np.array(search.iterations) + PLACES[FEEDBACK], np.array(means))
    strip = rr.LineStrips2D([line], colors=rgba([SKY], 2 * PALE), radii=-1.0, draw_order=-2.0)
    stream.log(_path(search, "costs", "network mean"), strip, static=True)


def _send_costs(stream: rr.RecordingStream, search: Search, diagram: Diagram, iteration: int) -> None:
    """Rollouts of this iteration with the mean of each kind, and how many failed."""
    for kind, colour in COLOURS.items():
        costs = search.rows(iteration, kind)["cost_rad"].to_numpy()
        if not len(costs):
            continue
        colours = cost_colours(costs, search.cost_range) if kind == SAMPLE else rgba([colour])
        dots = rr.Points2D(_cost_points(search, diagram, iteration, kind), colors=colours, radii=-3.5)
        stream.log(_path(search, "costs", kind), dots)
        place = diagram.points(iteration + PLACES[kind], costs.mean()) + LABELS[kind]
        stream.log(_path(search, "costs", kind, "mean"), texts([place], [f"{costs.mean():.1f}"], [colour]))
    failed = int(search.history.loc[search.history["iteration"] == iteration, "cost_rad"].isna().sum())
    if (search.history["cost_rad"].isna()).any():
        place = diagram.points(iteration, diagram.y_range[1])
        label = texts([place] * (failed > 0), [f"{failed} failed"] * (failed > 0), [VERMILION])
        stream.log(_path(search, "costs", "failed"), label)
