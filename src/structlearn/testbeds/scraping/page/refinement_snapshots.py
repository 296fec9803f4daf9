"""Figure IV.21 as a drawing: hand, tool and board seen along the roll axis, before and after refinement."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Patch, Polygon

from structlearn.palette import BLACK
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.figures import canvas, styled
from structlearn.reporting.prose import rounded
from structlearn.testbeds.scraping.page.execution_results import hand_roll_deg, moments, tool_roll_deg
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_figures import LOOKS
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE
from structlearn.testbeds.scraping.world.layout import CONTACT_M, EDGE_M, EDGE_WIDTH_M, GRASP_M

# All lengths in mm. Outlines (N, 2): x along the pinch, z up, from the grasp between the finger tips.
EDGE, HALF_EDGE, HAND = 1e3 * EDGE_M, 0.5e3 * EDGE_WIDTH_M, 1e3 * GRASP_M
TOOL = np.array(
    [(-6, 9), (6, 9), (6, -9), (4, -11), (HALF_EDGE, -EDGE), (-HALF_EDGE, -EDGE), (-4, -11), (-6, -9)]
)
FINGER = np.array([(6, -7), (9, -11), (13, -10), (16, -4), (21, HAND), (10, HAND), (7, 12), (6, 8)])
PALM = np.array(
    [(-25, HAND), (25, HAND), (25, HAND + 10), (19, HAND + 18), (-19, HAND + 18), (-25, HAND + 10)]
)
PARTS = (PALM, FINGER, FINGER * (-1, 1))

BOARD_LENGTH, BOARD_THICKNESS = 96.0, 5.0
HEIGHT_DRAWN = 13.0
"""From the board to the tool where it hovers, at most: drawn higher the angles would be small."""

BOARD_COLOUR = "#d9cdb8"
HAND_LOOKS = {
    BEFORE: {"facecolor": "#d3d9df", "linewidth": 0},
    AFTER: {"facecolor": "#6b7681", "edgecolor": "white", "linewidth": 0.6, "alpha": 0.92},
}
TOOL_LOOKS = {
    BEFORE: {"facecolor": "#a5d5f3", "linewidth": 0},
    AFTER: {"facecolor": LOOKS[AFTER][1], "edgecolor": "white", "linewidth": 0.6, "alpha": 0.92},
}

VIEW = (-48.0, 48.0, -17.0, 127.0)
CLOSE_UP = (-6.9, 6.9, -2.3, 3.9)


@dataclass(frozen=True)
class Snapshot:
    """One moment of an execution, seen along the roll axis.

    Attributes:
        hand_deg: roll of the hand.
        tool_deg: roll of the tool.
        off_deg: angle between tool and board.
        grasp: (2,) mm from where the edge meets the board, x to the right and z up.
    """

    hand_deg: float
    tool_deg: float
    off_deg: float
    grasp: np.ndarray


def snapshots(run: Demonstration, board_deg: float, axis: np.ndarray) -> list[Snapshot]:
    """An execution at its start and at the end of every primitive.

    The angles are as recorded. Hand and tool are moved up by what board and grasp give under the force, so
    that the edge lies on the board and not in it, and where they hover down to `HEIGHT_DRAWN`.

    Args:
        run: the execution.
        board_deg: roll of the board.
        axis: (3,) roll axis.
    """
    hand, off = hand_roll_deg(run, axis), tool_roll_deg(run, axis)
    normal = turned(np.array([0.0, 1.0]), board_deg)
    found = []
    for moment in moments(run):
        edge = 1e3 * (run.position[moment] - CONTACT_M)[[0, 2]]
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
def snapshots_figure(results: FeedbackResults) -> Figure:
    """Figure IV.21: one pair of executions at the tilt refined on; below, the tool's edge close up."""
    refinement = results.refinement
    board_deg = refinement.example_deg
    before, after = (snapshots(run, board_deg, refinement.axis) for run in refinement.pair)
    titles = ["Before the first primitive", *(f"End of {results.number(n)}. {n}" for n in results.primitives)]
    figure = canvas(5.4)
    wide, close = figure.subplots(2, len(titles), squeeze=False, height_ratios=(1.58, 0.45))
    for title, panel, detail, old, new in zip(titles, wide, close, before, after, strict=True):
        for axes, view in ((panel, VIEW), (detail, CLOSE_UP)):
            axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
            axes.set_axis_off()
            _board(axes, board_deg)
            _draw(axes, old, BEFORE)
            _draw(axes, new, AFTER)
        detail.add_patch(Polygon(_tool(old), fill=False, edgecolor=LOOKS[BEFORE][1], linewidth=1.4))
        panel.set_title(title, pad=19.0)
        _say(panel, f"hand {_change(old.hand_deg, new.hand_deg)}")
        _say(detail, f"tool off the board {_change(old.off_deg, new.off_deg)}")
    _tilt(wide[0], board_deg)
    _explain(close[0])
    handles = [
        *(Patch(facecolor=look["facecolor"], label=LOOKS[model][0]) for model, look in TOOL_LOOKS.items()),
        Patch(facecolor=BOARD_COLOUR, label=f"board at {board_deg:g}°"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, columnspacing=1.6)
    return figure


def _draw(axes: Axes, shot: Snapshot, model: str) -> None:
    """Hand and tool at one moment."""
    for outline in PARTS:
        axes.add_patch(Polygon(shot.grasp + turned(outline, shot.hand_deg), **HAND_LOOKS[model]))
    axes.add_patch(Polygon(_tool(shot), **TOOL_LOOKS[model]))


def _tool(shot: Snapshot) -> np.ndarray:
    return shot.grasp + turned(TOOL, shot.tool_deg)


def _board(axes: Axes, board_deg: float) -> None:
    half = 0.5 * BOARD_LENGTH
    outline = [(-half, 0.0), (half, 0.0), (half, -BOARD_THICKNESS), (-half, -BOARD_THICKNESS)]
    axes.add_patch(Polygon(turned(np.array(outline), board_deg), facecolor=BOARD_COLOUR, linewidth=0))
    surface = turned(np.array([(-half, 0.0), (half, 0.0)]), board_deg)
    axes.plot(*surface.T, color=BLACK, linewidth=1.0, zorder=1)


def _tilt(axes: Axes, board_deg: float) -> None:
    """The level, and the angle of the board to it."""
    reach = 0.46 * BOARD_LENGTH
    axes.plot([0.0, reach], [0.0, 0.0], color=BLACK, linewidth=0.8, linestyle=":")
    first, second = sorted((0.0, -board_deg))
    axes.add_patch(Arc((0.0, 0.0), 1.7 * reach, 1.7 * reach, theta1=first, theta2=second, color=BLACK))
    axes.text(0.99 * reach, 1.5, f"{board_deg:g}°", ha="right", va="bottom", fontsize=8.5)


def _say(axes: Axes, text: str) -> None:
    """Above the panel's picture."""
    axes.text(0.5, 1.0, text, transform=axes.transAxes, ha="center", va="bottom", fontsize=8.5)


def _explain(axes: Axes) -> None:
    """Instead of the edge close up where it hovers."""
    axes.clear()
    axes.set_axis_off()
    axes.set_aspect("auto")
    width = f"{2.0 * HALF_EDGE:.0f} mm"
    text = f"Close up: the tool's edge,\n{width} wide. At 0° off, it\nlies flat on the board."
    axes.text(0.0, 0.5, text, va="center", fontsize=8.5)


def _change(old: float, new: float) -> str:
    """`3.1° → 1.0°`; one number where they are the same."""
    before, after = rounded(old, ".1f"), rounded(new, ".1f")
    return f"{before}°" if before == after else f"{before}° → {after}°"
