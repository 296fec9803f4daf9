"""Style of all figures, and how they become files.

Figures are made without pyplot: no global state, no window, the Agg canvas only. The files carry no version
and no date, so the same data give the same bytes.
"""

from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image

from structlearn.palette import BLACK, LIGHT_GREY

WIDTH = 9.4
"""Inches; every figure has this width, so that letters have one size on a page."""

DPI = 150
COLOURS = 256
"""Colours of a file; more than a line plot needs, and a third of the bytes of true colour."""

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": BLACK,
    "axes.edgecolor": "#9aa2ab",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "#e9ecef",
    "grid.linewidth": 0.7,
    "xtick.color": "#9aa2ab",
    "ytick.color": "#9aa2ab",
    "xtick.labelcolor": BLACK,
    "ytick.labelcolor": BLACK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 1.6,
    "text.color": BLACK,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.09,
    "figure.constrained_layout.w_pad": 0.06,
}

Plot = TypeVar("Plot", bound=Callable[..., Figure])


@contextmanager
def style():
    """Matplotlib's defaults, whatever the user's own settings, with the project's style."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def styled(plot: Plot) -> Plot:
    """Decorator of functions that make a figure: they run in the project's style."""

    def in_style(*arguments: Any, **options: Any) -> Figure:
        with style():
            return plot(*arguments, **options)

    in_style.__doc__, in_style.__name__ = plot.__doc__, plot.__name__
    return in_style


def canvas(height: float) -> Figure:
    """An empty figure of the page's width; height in inches."""
    return Figure(figsize=(WIDTH, height), dpi=DPI)


def save(figure: Figure, path: str | Path) -> tuple[int, int]:
    """Write a figure as PNG with a palette of colours and no metadata.

    Returns:
        Width and height in pixels.
    """
    with style():
        agg = FigureCanvasAgg(figure)
        agg.draw()
    picture = Image.fromarray(np.asarray(agg.buffer_rgba())).convert("RGB")
    indexed = picture.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    indexed.save(path, format="PNG", optimize=True)
    return picture.size


def legend_above(figure: Figure, axes: Axes, columns: int = 6) -> None:
    """One legend for a whole figure, in a line above it, of what is labelled in one of its axes."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, columnspacing=1.6)


def space_panels(figure: Figure) -> tuple[Axes, Axes]:
    """A 3-D panel, and beside it one for the view from above."""
    grid = figure.add_gridspec(1, 2, width_ratios=(1.25, 1.0))
    return figure.add_subplot(grid[0], projection="3d"), figure.add_subplot(grid[1])


def finish_space(space: Axes, above: Axes, points: np.ndarray) -> None:
    """Labels, views and limits of both panels for points (N, 3) in mm.

    In the 3-D panel a millimetre is the same on all axes; a flat axis is widened so that its labels fit.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    longest = (high - low).max()
    half = np.maximum(0.54 * (high - low), 0.25 * longest)
    middle = 0.5 * (low + high)
    low, high = middle - half, middle + half
    space.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    space.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)")
    space.set_box_aspect(half, zoom=1.02)
    space.view_init(elev=20.0, azim=-38.0)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.pane.set_facecolor("white")
        axis.pane.set_edgecolor(LIGHT_GREY)
        axis.set_major_locator(MaxNLocator(4, steps=(1, 2, 5, 10)))
    above.set(title="From above (axes scaled separately)", xlabel="y (mm)", ylabel="x (mm)")
    above.invert_yaxis()  # y to the right and z towards the reader: x points down
