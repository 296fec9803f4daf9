"""Figures of one panel each, which a page sets side by side where there is room."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from structlearn.palette import place_colours
from structlearn.reporting.figure_style import PANEL_WIDTH, Raster, canvas, styled

HEIGHT = 3.1  # inches of a panel
SAMPLES = 60  # of a curve among a hundred; no eye sees more


def panel(title: str, height: float = HEIGHT, **labels: object) -> tuple[Figure, Axes]:
    """An empty panel with what `Axes.set` takes; height in inches."""
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set(**labels)
    axes.set_title(title, pad=8)
    return figure, axes


def legend(figure: Figure, columns: int = 2) -> Figure:
    """The same figure, with a legend above its panel."""
    figure.legend(loc="outside upper left", ncols=columns, columnspacing=1.2)
    return figure


@styled
def map_panels(lies: pd.DataFrame, titles: Sequence[str], height: float, margin_mm: float) -> list[Raster]:
    """Places of touches on a skin (`x_m`, `y_m`), and where they lie in its map (`map_x_m`, `map_y_m`)."""
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
