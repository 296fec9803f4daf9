"""Style and files of all figures.

Figures are made without pyplot: no global state, no window. Lines become SVG, with text as paths so that it
looks the same everywhere; figures with very many points (`Raster`) and images of simulated scenes become PNG.
Files carry no version and no date, so the same data give the same bytes. SVG is transparent: on dark screens,
pages invert what is drawn and keep its hues; images of scenes stay as they are.

Draw several panels as several figures of `PANEL_WIDTH`: the page sets them side by side if there is room, and
one below the other on a phone, where their text stays readable.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from PIL import Image

from structlearn.palette import BLACK, LIGHT_GREY, place_colours

WIDTH = 9.4  # inches, page width; common to all figures, so that their text has one size
PANEL_WIDTH = 4.7  # inches of a panel; two fit side by side on a wide page

DPI = 150
COLOURS = 256  # in PNG files, which then have a third of the bytes of true colour
EDGE = "#868e97"  # axes and ticks: contrast 3:1

STYLE: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same font on every machine
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": BLACK,
    "axes.edgecolor": EDGE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "#e9ecef",
    "grid.linewidth": 0.7,
    "xtick.color": EDGE,
    "ytick.color": EDGE,
    "xtick.labelcolor": BLACK,
    "ytick.labelcolor": BLACK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "legend.facecolor": "white",  # so that lines do not cross the text
    "legend.edgecolor": "none",
    "legend.fancybox": False,
    "legend.borderpad": 0.2,
    "legend.fontsize": 8.5,
    "legend.handlelength": 1.6,
    "text.color": BLACK,
    "svg.fonttype": "path",
    "svg.hashsalt": "structlearn",  # makes ids inside a file depend on its content only
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.09,
    "figure.constrained_layout.w_pad": 0.06,
}


@contextmanager
def style() -> Iterator[None]:
    """Apply the project's style on Matplotlib's defaults, ignoring the user's settings."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


styled = style()  # decorator for functions that make figures


@dataclass(frozen=True)
class Raster:
    """A figure saved as PNG because it has too many points for SVG."""

    figure: Figure


Drawing = Figure | Raster | np.ndarray  # one file; an array is an image (H, W, 3) uint8


def canvas(height: float, width: float = WIDTH) -> Figure:
    """Empty figure; height and width in inches."""
    return Figure(figsize=(width, height), dpi=DPI)


def save(drawing: Drawing, path: Path) -> tuple[Path, tuple[int, int]]:
    """Write a drawing as SVG or PNG; return its path, and width and height in CSS pixels."""
    if isinstance(drawing, Figure):
        path = path.with_name(f"{path.name}.svg")
        with style():  # `savefig` would draw twice, to compute the layout
            FigureCanvasSVG(drawing).print_svg(path, metadata={"Date": None, "Creator": None})
        return path, (round(96 * drawing.get_figwidth()), round(96 * drawing.get_figheight()))
    path = path.with_name(f"{path.name}.png")
    if isinstance(drawing, Raster):
        with style():
            drawing.figure.set_facecolor("white")
            agg = FigureCanvasAgg(drawing.figure)
            agg.draw()
        drawing = np.asarray(agg.buffer_rgba())[..., :3]
    picture = Image.fromarray(drawing)
    indexed = picture.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    indexed.save(path, format="PNG", optimize=True)
    return path, picture.size


def finish_space(space: Axes3D, above: Axes, points: np.ndarray) -> None:
    """Set labels, views and limits of both panels for points (N, 3) mm; the 3-D panel has equal scales."""
    low, high = points.min(axis=0), points.max(axis=0)
    longest = (high - low).max()
    half = np.maximum(0.54 * (high - low), 0.25 * longest)  # flat axes are widened to fit their labels
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
    above.invert_yaxis()  # y to the right, z towards the viewer, so x points down


HEIGHT = 3.1  # inches of a panel
SAMPLES = 60  # per curve where a hundred are drawn


def panel(title: str, height: float = HEIGHT, **labels: object) -> tuple[Figure, Axes]:
    """Empty panel with options of `Axes.set`; height in inches."""
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set(**labels)
    axes.set_title(title, pad=8)
    return figure, axes


def legend(figure: Figure, columns: int = 2) -> Figure:
    """Add a legend above the figure's panel, and return the figure."""
    figure.legend(loc="outside upper left", ncols=columns, columnspacing=1.2)
    return figure


@styled
def map_panels(lies: pd.DataFrame, titles: Sequence[str], height: float, margin_mm: float) -> list[Raster]:
    """Contact positions on a skin (`x_m`, `y_m`) and in its learned map (`map_x_m`, `map_y_m`)."""
    places, mapped = (1e3 * lies[columns].to_numpy() for columns in (["x_m", "y_m"], ["map_x_m", "map_y_m"]))
    colours, middle = place_colours(places) / 255.0, 0.5 * (places.min(axis=0) + places.max(axis=0))
    half = 0.5 * np.ptp(places, axis=0).max() + margin_mm
    figures = []
    for title, points in zip(titles, (places - middle, mapped - middle), strict=True):
        figure, axes = panel(title, height, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        axes.set(xlim=(-half, half), ylim=(-half, half))
        axes.scatter(points[:, 0], points[:, 1], s=5.0, c=colours, linewidths=0)
        figures.append(Raster(figure))
    return figures
