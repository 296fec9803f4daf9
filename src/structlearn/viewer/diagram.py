"""Flat diagrams in recordings: axes for curves over quantities other than the time lines."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.palette import GREY
from structlearn.viewer import views
from structlearn.viewer.items import Item, lines, texts
from structlearn.viewer.views import Panel

GRID = "#262b31"  # just visible on the viewer's dark background
LEFT, RIGHT, ABOVE, BELOW = 2.6, 1.0, 1.6, 2.2  # room around the axes for their numbers and names
TICKS = 6  # approximate intervals per axis


@dataclass(frozen=True)
class Diagram:
    """Axes of a flat drawing, x to the right and y upwards."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    width: float  # drawing units
    height: float

    def points(self, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
        """Drawing coordinates (..., 2) of values x and y (...)."""
        (left, right), (bottom, top) = self.x_range, self.y_range
        across = self.width * (np.asarray(x, float) - left) / (right - left)
        down = self.height * (top - np.asarray(y, float)) / (top - bottom)
        return np.stack(np.broadcast_arrays(across, down), axis=-1)


def rounded_range(values: np.ndarray, least: float | None = None) -> tuple[float, float]:
    """Range of whole ticks around all values (...), starting at `least` if given."""
    low, high = float(np.min(values)), float(np.max(values))
    low = low if least is None else least
    step = tick_step(low, high)
    return (step * np.floor(low / step), step * np.ceil(high / step)) if high > low else (low, low + 1.0)


def tick_step(low: float, high: float) -> float:
    """Tick spacing: 1, 2 or 5 times a power of ten."""
    rough = max(high - low, np.finfo(float).tiny) / TICKS
    power = 10.0 ** np.floor(np.log10(rough))
    return float(next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= 0.999 * rough))


def axes(path: str, diagram: Diagram, x_name: str, x_ticks: Sequence[float] | None = None) -> list[Item]:
    """A diagram's grid with its numbers; the name of y belongs in the view's heading."""
    (left, right), (bottom, top) = diagram.x_range, diagram.y_range
    xs = _ticks(left, right) if x_ticks is None else np.asarray(x_ticks, float)
    ys = _ticks(bottom, top)
    upright = diagram.points(xs[:, None], np.array([bottom, top]))  # (X, 2, 2)
    level = diagram.points(np.array([left, right]), ys[:, None])  # (Y, 2, 2)
    zero = np.isclose(ys, 0.0, atol=1e-9 * (top - bottom))
    colours = [GRID] * len(xs) + [GREY if at_zero else GRID for at_zero in zero]
    grid = lines(path, np.concatenate([upright, level]), colours, -0.6, draw_order=-9.0)
    below = diagram.points(xs, bottom) + np.array([0.0, 0.1])
    beside = diagram.points(left, ys) - np.array([0.45 * LEFT, 0.5])  # labels hang below their points
    name = diagram.points(0.5 * (left + right), bottom) + np.array([0.0, 0.5 * BELOW])
    labels = [*(f"{value:g}" for value in [*xs, *ys]), x_name]
    return [grid, texts(f"{path}/numbers", [*below, *beside, name], labels, GREY)]


def diagram_view(name: str, items: Iterable[Item], diagram: Diagram) -> Panel:
    """View of what is drawn in a diagram."""
    return views.flat(name, items, [-LEFT, diagram.width + RIGHT], [-ABOVE, diagram.height + BELOW])


def _ticks(low: float, high: float) -> np.ndarray:
    step = tick_step(low, high)
    count = np.arange(np.ceil(low / step - 1e-6), np.floor(high / step + 1e-6) + 1)
    return np.round(step * count, 12) + 0.0  # avoids -0
