"""Figures of one panel each, which a page sets side by side where there is room."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from structlearn.reporting.figure_style import PANEL_WIDTH, canvas

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
