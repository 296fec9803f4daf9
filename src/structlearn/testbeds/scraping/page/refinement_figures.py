"""Figures of the refinement by trial: IV.19, what the search costs in rollouts, and IV.21 as a drawing."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from structlearn.palette import BLACK
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.prose import capitalised, rounded
from structlearn.testbeds.scraping.names import ROLLOUTS, RUNS, SEARCHES, primitive_title
from structlearn.testbeds.scraping.page.board_results import PUBLISHED_ITERATIONS, RefinementResults, moments
from structlearn.testbeds.scraping.page.feedback_figures import panel
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE
from structlearn.testbeds.scraping.world import layout

CLOUD_WIDTH = 0.26
"""Iterations over which the cloud of samples is spread, halfway between two executions of the network."""

# All lengths in mm. Outlines (N, 2): x along the pinch, z up, from the grasp between the finger tips.
EDGE, HALF_EDGE, HAND = 1e3 * layout.EDGE_M, 0.5e3 * layout.EDGE_WIDTH_M, 1e3 * layout.GRASP_M
TOOL = np.array(
    [(-6, 9), (6, 9), (6, -9), (4, -11), (HALF_EDGE, -EDGE), (-HALF_EDGE, -EDGE), (-4, -11), (-6, -9)]
)
FINGER = np.array([(6, -7), (9, -11), (13, -10), (16, -4), (21, HAND), (10, HAND), (7, 12), (6, 8)])
PALM = np.array(
    [(-25, HAND), (25, HAND), (25, HAND + 10), (19, HAND + 18), (-19, HAND + 18), (-25, HAND + 10)]
)
PARTS = (PALM, FINGER, FINGER * (-1, 1))

BOARD_LENGTH, BOARD_THICKNESS = 96.0, 5.0
BOARD_COLOUR = "#d9cdb8"
HAND_COLOURS = {BEFORE: "#d3d9df", AFTER: "#6b7681"}
HEIGHT_DRAWN = 13.0
"""From the board to the tool where it hovers, at most: drawn higher the angles would be small."""

VIEW, CLOSE_UP = (-48.0, 48.0, -17.0, 98.0), (-9.0, 9.0, -2.6, 4.0)  # mm, left, right, bottom, top


@styled
def learning_figure(results: RefinementResults, names: list[str]) -> list[Figure]:
    """Figure IV.19: cost over the iterations, with the network, by the improved policies, and the samples."""
    figures = []
    for name in results.refined:
        figure, axes = panel(primitive_title(names, name))
        own = results.history[results.history["primitive"] == name]
        look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.0, "markeredgewidth": 0}
        colour = ROLLOUTS[SAMPLE].colour
        for iteration, rows in own[own["kind"] == SAMPLE].groupby("iteration"):
            # number by number from left to right: nothing is drawn at random
            x = iteration - 0.5 + CLOUD_WIDTH * (np.arange(len(rows)) / max(len(rows) - 1, 1) - 0.5)
            label = ROLLOUTS[SAMPLE].name if iteration == 1 else None
            axes.plot(x, rows["cost_rad"], color=colour, label=label, **look)
        for kind, beside, marker, line in ((IMPROVED, -0.18, "D", "none"), (FEEDBACK, 0.0, "o", "-")):
            rows = results.curve(name, kind)
            look = {"color": ROLLOUTS[kind].colour, "marker": marker, "linestyle": line, "capsize": 3.0}
            bars = np.nan_to_num(rows["std"])
            axes.errorbar(rows.index + beside, rows["mean"], bars, label=ROLLOUTS[kind].name, **look)
        failed = own[own["fault"] != ""]
        if len(failed):
            look = {"transform": axes.get_xaxis_transform(), "clip_on": False, "label": "failed rollouts"}
            axes.plot(failed["iteration"] - 0.5, np.ones(len(failed)), "x", color=BLACK, **look)
        look = {"color": BLACK, "linestyle": ":", "linewidth": 1.0, "zorder": 1}
        axes.axvline(PUBLISHED_ITERATIONS, **look, label="converged, as published")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(axis="x", visible=False)
        axes.set(xlabel="iteration", ylabel="accumulated cost (rad)", ylim=(0.0, 1.5 * axes.get_ylim()[1]))
        axes.legend(ncols=2)
        figures.append(figure)
    return figures


@styled
def search_figure(results: RefinementResults, names: list[str]) -> list[Figure]:
    """Cost of the mean policy over the rollouts used, PI2-CMA beside CMA-ES; mean and range of searches."""
    figures = []
    for name in results.searched_primitives:
        figure, axes = panel(primitive_title(names, name), 2.6)
        rows = results.searches[results.searches["primitive"] == name]
        for method, (label, colour) in SEARCHES.items():
            own = rows[rows["method"] == method]
            axes.fill_between(own["rollouts"], own["low"], own["high"], color=colour, alpha=0.18, linewidth=0)
            axes.plot(own["rollouts"], own["mean"], "o-", color=colour, markersize=4, label=label)
        axes.set(xlabel="rollouts used", ylabel="cost of the mean policy (rad)", ylim=(0.0, None))
        axes.legend()
        figures.append(figure)
    return figures


@dataclass(frozen=True)
class Snapshot:
    """One moment of an execution, seen along the roll axis."""

    hand_deg: float  # roll of the hand
    tool_deg: float  # roll of the tool
    off_deg: float  # angle between tool and board
    grasp: np.ndarray  # (2,) mm from where the edge meets the board, x to the right and z up


def snapshots(run: Demonstration, board_deg: float, axis: np.ndarray) -> list[Snapshot]:
    """An execution at its start and at the end of every primitive.

    The angles are as recorded. Hand and tool are moved up by what board and grasp give under the force, so
    that the edge lies on the board and not in it, and where they hover down to `HEIGHT_DRAWN`.

    `axis`: (3,) roll axis.
    """
    hand, off = layout.hand_roll_deg(run, axis), layout.tool_roll_deg(run, axis)
    normal = turned(np.array([0.0, 1.0]), board_deg)
    found = []
    for moment in moments(run):
        edge = 1e3 * (run.position[moment] - layout.CONTACT_M)[[0, 2]]
        grasp = edge + turned(np.array([0.0, EDGE]), hand[moment])
        tool_deg = board_deg + off[moment]
        corners = grasp + turned(np.array([[-HALF_EDGE, -EDGE], [HALF_EDGE, -EDGE]]), tool_deg)
        height = float((corners @ normal).min())
        grasp[1] += (np.clip(height, 0.0, HEIGHT_DRAWN) - height) / normal[1]
        found.append(Snapshot(float(hand[moment]), float(tool_deg), float(abs(off[moment])), grasp))
    return found


def turned(points: np.ndarray, roll_deg: float) -> np.ndarray:
    """Points (..., 2) turned about the roll axis, which points away from the reader: clockwise."""
    cos, sin = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    return points @ np.array([[cos, -sin], [sin, cos]])


@styled
def snapshots_figure(results: RefinementResults, names: list[str]) -> list[Figure]:
    """Figure IV.21: one pair of executions at the tilt refined on; two moments a panel, below close up."""
    runs = [snapshots(run, results.example_deg, results.axis) for run in results.pair]
    titles = ["before the first", *(f"end of {name}" for name in names)]
    moments_shown = list(zip(titles, *runs, strict=True))
    figures = []
    for first in range(0, len(moments_shown), 2):
        figures.append(canvas(4.2, PANEL_WIDTH))
        columns = figures[-1].subplots(2, 2, height_ratios=(VIEW[3] - VIEW[2], 40.0)).T
        for (wide, close), (title, before, after) in zip(
            columns, moments_shown[first : first + 2], strict=False
        ):
            for axes, view in ((wide, VIEW), (close, CLOSE_UP)):
                axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
                _draw_board(axes, results.example_deg)
                for model, shot in ((BEFORE, before), (AFTER, after)):
                    _draw_shot(axes, model, shot)
            wide.set_title(f"{capitalised(title)}\nhand {_change(before.hand_deg, after.hand_deg)}")
            close.set_title(f"tool off by {_change(before.off_deg, after.off_deg)}", fontsize=8.5)
        for axes in columns.ravel():
            axes.set_axis_off()
    figures[0].axes[2].legend(loc="upper right", fontsize=7.5)  # where nothing lies on the board yet
    return figures


def _draw_shot(axes: Axes, model: str, shot: Snapshot) -> None:
    """Hand and tool at one moment, pale before refinement."""
    opacity = 0.9 if model == BEFORE else 0.75
    look: dict[str, Any] = {"edgecolor": "white", "linewidth": 0.6, "alpha": opacity}
    for outline in PARTS:
        corners = shot.grasp + turned(outline, shot.hand_deg)
        axes.add_patch(Polygon(corners, facecolor=HAND_COLOURS[model], **look))
    tool = shot.grasp + turned(TOOL, shot.tool_deg)
    axes.add_patch(Polygon(tool, facecolor=RUNS[model].colour, label=RUNS[model].name, **look))
    axes.add_patch(Polygon(tool, fill=False, edgecolor=RUNS[model].colour, linewidth=1.4, zorder=3))


def _draw_board(axes: Axes, board_deg: float) -> None:
    half = 0.5 * BOARD_LENGTH
    outline = [(-half, 0.0), (half, 0.0), (half, -BOARD_THICKNESS), (-half, -BOARD_THICKNESS)]
    axes.add_patch(Polygon(turned(np.array(outline), board_deg), facecolor=BOARD_COLOUR, linewidth=0))
    surface = turned(np.array([(-half, 0.0), (half, 0.0)]), board_deg)
    axes.plot(*surface.T, color=BLACK, linewidth=1.0, zorder=1)
    axes.text(0.8 * half, 2.0, f"{board_deg:g}°", ha="right", fontsize=8.5, clip_on=True)


def _change(old: float, new: float) -> str:
    """`3.1° → 1.0°`; one number where they are the same."""
    before, after = rounded(old, ".1f"), rounded(new, ".1f")
    return f"{before}°" if before == after else f"{before}° → {after}°"
