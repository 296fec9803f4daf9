"""Figures of the refinement by trial: figures IV.19 and IV.20, and what the search costs in rollouts."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from structlearn.palette import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION
from structlearn.policy_search.rollouts import FEEDBACK, IMPROVED, SAMPLE
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.figures import canvas, styled
from structlearn.testbeds.scraping.page.board_figures import cost_bars
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_results import PUBLISHED_ITERATIONS, RefinementResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL

LOOKS = {
    NOMINAL: ("no feedback", GREEN),
    BEFORE: ("before refinement", SKY),
    AFTER: ("after refinement", BLUE),
}
"""Name and colour of every set of executions."""

METHODS = {PI2: ("PI2-CMA", BLUE), CMA_ES: ("CMA-ES", ORANGE)}
"""Name and colour of every search."""

SAMPLE_COLOUR = "#b4bac1"
CLOUD_WIDTH = 0.26
"""Iterations over which the cloud of samples is spread, halfway between two executions of the network."""


@styled
def learning_figure(results: FeedbackResults) -> Figure:
    """Figure IV.19: cost over the iterations, with the network, by the improved policies, and the samples."""
    refinement = results.refinement
    figure = canvas(4.0)
    panels = figure.subplots(1, len(refinement.refined), squeeze=False)[0]
    for panel, name in zip(panels, refinement.refined, strict=True):
        _samples(panel, refinement.history[refinement.history["primitive"] == name])
        curves = refinement.curves[refinement.curves["primitive"] == name].set_index("kind")
        improved, network = (curves.loc[curves.index == kind] for kind in (IMPROVED, FEEDBACK))
        look = {"color": VERMILION, "linestyle": "none", "marker": "D", "markersize": 4.5, "capsize": 2.5}
        panel.errorbar(improved["iteration"] - 0.18, improved["mean"], _spread(improved), **look)
        look = {"color": BLUE, "marker": "o", "markersize": 5.5, "linewidth": 1.8, "capsize": 3.5}
        panel.errorbar(network["iteration"], network["mean"], _spread(network), **look, zorder=4)
        panel.axvline(PUBLISHED_ITERATIONS, color=BLACK, linestyle=":", linewidth=1.0, zorder=1)
        last = max(refinement.iterations[name], PUBLISHED_ITERATIONS)
        panel.set(xlim=(-0.35, last + 0.35), title=f"{results.number(name)}. {name}", xlabel="iteration")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.grid(axis="x", visible=False)
        panel.set_ylim(bottom=0.0)
    panels[0].set_ylabel("accumulated cost (rad)")
    handles = [
        Line2D([], [], color=BLUE, marker="o", label="with the network, mean ± std"),
        Line2D([], [], color=VERMILION, marker="D", linestyle="none", label="improved policy, mean ± std"),
        Line2D([], [], color=SAMPLE_COLOUR, marker="o", markersize=4, linestyle="none", label="samples"),
        Line2D([], [], color=BLACK, linestyle=":", linewidth=1.0, label="published: converged"),
    ]
    if len(refinement.faults):
        handles.append(Line2D([], [], color=BLACK, marker="x", linestyle="none", label="failed rollouts"))
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


def _samples(panel: Axes, history: pd.DataFrame) -> None:
    """The drawn policies between the networks before and after; failed rollouts at the upper edge."""
    for iteration, rows in history[history["kind"] == SAMPLE].groupby("iteration"):
        # number by number from left to right: nothing is drawn at random
        x = iteration - 0.5 + CLOUD_WIDTH * (np.arange(len(rows)) / max(len(rows) - 1, 1) - 0.5)
        look = {"linestyle": "none", "marker": "o", "markersize": 3.0, "markeredgewidth": 0}
        panel.plot(x, rows["cost_rad"], color=SAMPLE_COLOUR, **look)
    failed = history[history["fault"] != ""]
    x = failed["iteration"] - np.where(failed["kind"] == SAMPLE, 0.5, 0.0)
    if len(failed):
        edge = {"transform": panel.get_xaxis_transform(), "clip_on": False}
        panel.plot(x, np.ones(len(x)), color=BLACK, linestyle="none", marker="x", markersize=5, **edge)


def _spread(rows: pd.DataFrame) -> np.ndarray:
    return np.nan_to_num(rows["std"].to_numpy())


def cost_figure(results: FeedbackResults) -> Figure:
    """Figure IV.20: accumulated cost without feedback, before and after refinement, in every setting."""
    refinement = results.refinement
    ticks = [f"{setting:g}\n{role(refinement, setting)}" for setting in refinement.settings_deg]
    titles = {name: f"{results.number(name)}. {name}" for name in refinement.primitives}
    return cost_bars(refinement, titles, LOOKS, ticks, "roll of the board (°)")


def role(refinement: RefinementResults, setting: float) -> str:
    """What a setting was to the models, in one word."""
    if setting == refinement.example_deg:
        return "refined"
    if setting in refinement.seen_deg:
        return "learned"
    return "default" if setting == 0.0 else "unseen"


@styled
def search_figure(results: FeedbackResults) -> Figure:
    """Cost of the mean policy over the rollouts used, PI2-CMA beside CMA-ES; mean and range of searches."""
    refinement = results.refinement
    figure = canvas(3.6)
    names = refinement.searched_primitives
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        rows = refinement.searches[refinement.searches["primitive"] == name].set_index("method")
        for method, (_, colour) in METHODS.items():
            own = rows.loc[rows.index == method]
            panel.fill_between(
                own["rollouts"], own["low"], own["high"], color=colour, alpha=0.18, linewidth=0
            )
            panel.plot(own["rollouts"], own["mean"], color=colour, marker="o", markersize=4)
        panel.set(title=f"{results.number(name)}. {name}", xlabel="rollouts used")
        panel.set_ylim(bottom=0.0)
    panels[0].set_ylabel("cost of the mean policy (rad)")
    handles = [
        Line2D([], [], color=colour, marker="o", markersize=4, label=f"{label}, mean and range")
        for label, colour in METHODS.values()
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure
