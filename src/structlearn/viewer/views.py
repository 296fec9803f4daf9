"""Panels of a recording: views of items, beside each other, below each other, or in tabs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import COLOUR_NAMES
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer.items import FLOOR_SQUARE_M, RESTING, Item, entity, rgba

NEAREST = 0.06  # m; distance of the camera in scenes in which hardly anything but the orientation moves
HALF_FIELD_OF_VIEW = np.radians(27.5)  # of rerun's camera, from the centre of a view to its upper edge
NARROWEST = 0.8  # width over height of the narrowest 3-D view that should show the whole scene
ROOM = 1.15  # factor on the distance at which all points are just visible, for frames and labels
ELEVATION = np.radians(25.0)  # of the camera: shows both paths on a board and heights
GROUND = (13, 13, 13)  # RGB background, dark also in browsers with a light theme
NOTES = "what is shown"


class Panel(NamedTuple):
    """A part of the viewer's window, and what it shows."""

    layout: rrb.View | rrb.Container
    items: tuple[Item, ...]


def row(*panels: Panel, shares: Sequence[float] | None = None, name: str | None = None) -> Panel:
    """Panels beside each other; `shares`: of the width."""
    return _joined(rrb.Horizontal, panels, column_shares=shares, name=name)


def column(*panels: Panel, shares: Sequence[float] | None = None) -> Panel:
    """Panels below each other; `shares`: of the height."""
    return _joined(rrb.Vertical, panels, row_shares=shares)


def grid(*panels: Panel, columns: int = 2, name: str | None = None) -> Panel:
    """Panels in columns."""
    return _joined(rrb.Grid, panels, grid_columns=columns, name=name)


def tabs(*panels: Panel, active: int = 0) -> Panel:
    """Panels of which one is visible."""
    return _joined(rrb.Tabs, panels, active_tab=active)


def _joined(kind: Any, panels: Sequence[Panel], **look: Any) -> Panel:
    items = tuple(item for panel in panels for item in panel.items)
    return Panel(kind(*(panel.layout for panel in panels), **look), items)


def _view(kind: Any, name: str, items: Iterable[Item], **look: Any) -> Panel:
    items = tuple(items)
    contents = list(dict.fromkeys(item.path for item in items))
    return Panel(kind(name=name, origin="/", contents=contents, **look), items)


def scene(name: str, items: Iterable[Item], points: np.ndarray) -> Panel:
    """3-D view of points (N, 3) m, along the horizontal direction of least extent and slightly from above."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    horizontal = points[:, :2] - points[:, :2].mean(axis=0)
    least = np.linalg.eigh(horizontal.T @ horizontal)[1][:, 0]
    least = least if least.sum() >= 0 else -least  # eigenvectors have arbitrary sign; keep one side
    backward = np.array([*(np.cos(ELEVATION) * least), np.sin(ELEVATION)])
    right = np.array([-least[1], least[0], 0.0])
    across = np.abs((points - centre) @ np.column_stack([right, np.cross(backward, right)]))  # (N, 2)
    needed = np.max(across / [NARROWEST, 1.0], axis=1) / np.tan(HALF_FIELD_OF_VIEW)
    distance = max(float(np.max(needed + (points - centre) @ backward)), NEAREST)
    return eye(name, items, centre, ROOM * distance * backward)


def eye(name: str, items: Iterable[Item], target: np.ndarray, from_target: np.ndarray) -> Panel:
    """3-D view of `target` (3,) m from the relative position `from_target` (3,) m, with the items' floor."""
    items = tuple(items)
    floor = next((item.floor_m for item in items if item.floor_m is not None), None)
    plane = rr.components.Plane3D.XY.with_distance(floor or 0.0)
    lines = {"spacing": FLOOR_SQUARE_M, "plane": plane, "color": rgba(RESTING)[0]}
    eyes: dict[str, Any] = {"kind": rrb.Eye3DKind.Orbital, "eye_up": [0.0, 0.0, 1.0]}
    return _view(
        *(rrb.Spatial3DView, name, items),
        background=GROUND,
        eye_controls=rrb.EyeControls3D(position=target + from_target, look_target=target, **eyes),
        line_grid=floor is not None and rrb.LineGrid3D(visible=True, **lines),
    )


def flat(name: str, items: Iterable[Item], x_range: Sequence[float], y_range: Sequence[float]) -> Panel:
    """2-D view of a drawing, y downwards."""
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return _view(rrb.Spatial2DView, name, items, background=GROUND, visual_bounds=bounds)


def plot(
    name: str, items: Iterable[Item], legend: bool = True, limits: tuple[float, float] | None = None
) -> Panel:
    """Plot over time, with its time axis linked to all others; `limits`: of values."""
    background = rrb.archetypes.PlotBackground(color=GROUND)
    corner = rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend)
    axes: dict[str, Any] = {"axis_x": rrb.TimeAxis(link="LinkToGlobal")}
    if limits is not None:
        axes["axis_y"] = rrb.ScalarAxis(range=limits)
    return _view(rrb.TimeSeriesView, name, items, background=background, plot_legend=corner, **axes)


def plots(curves: Mapping[str, Iterable[Item]], legend: bool = True) -> list[Panel]:
    """A plot for each heading."""
    return [plot(name, items, legend) for name, items in curves.items()]


def lanes(items: Iterable[Item]) -> Panel:
    """Lanes of primitives over time."""
    return _view(rrb.StateTimelineView, "Primitives", items)


def notes(text: str, *parts: str) -> Panel:
    """Panel of notes in Markdown; `parts`: of the entity's path, to tell several apart."""
    item = Item(entity("notes", *parts), [rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)])
    return notes_view(NOTES, item)


def notes_view(name: str, item: Item) -> Panel:
    """Panel of an item with text."""
    return Panel(rrb.TextDocumentView(name=name, origin=item.path, contents=[item.path]), (item,))


def legend(colours: Mapping[str, str]) -> str:
    """Markdown legend, on one line since panels are low, from colours keyed by name."""
    return " · ".join(f"**{COLOUR_NAMES.get(colour, colour)}** {name}" for name, colour in colours.items())


def table(heads: str, rows: Sequence[str]) -> str:
    """Markdown table of a row of heads and other rows, `| a | b |`."""
    return "\n".join([heads, "|---" * (heads.count("|") - 1) + "|", *rows])


def origin_label(demonstrations: Sequence[Demonstration]) -> str:
    """Suffix for headings that labels simulated data; empty if all data were recorded."""
    simulated = sum(demonstration.simulated for demonstration in demonstrations)
    if simulated in (0, len(demonstrations)):
        return " (simulated)" if simulated else ""
    return f" ({simulated} of {len(demonstrations)} simulated)"


def origin_sentence(runs: Sequence[Demonstration], subject: str = "Everything here is") -> str:
    """Sentence that says whether runs are simulated or recorded."""
    simulated = sum(run.simulated for run in runs)
    if simulated in (0, len(runs)):
        return f"{subject} {'simulated' if simulated else 'recorded'}."
    return f"{simulated} of {len(runs)} runs are simulated, the others recorded."
