"""3-D scenes and plots of executions: tilted board, hand pinching the tool, electrodes and signals.

Frames are those of the simulation, all with x along the pinch, y along the scraping direction and z along the
fingers: `hand` is the recorded frame, at the place of the tool's edge in an unloaded grasp; the grasp lies
between the finger tips, and the tool turns about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import rerun as rr

from dissertation.scraping.world import layout
from dissertation.simulation.fingers import HOME_MM, PAD_DISTANCE_MM
from structlearn.core import quaternion
from structlearn.palette import GREY, WHITE, Look
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import ELECTRODES_MM, SKIN_RADIUS_MM
from structlearn.viewer import items, views
from structlearn.viewer.items import Item, entity
from structlearn.viewer.views import Panel

WRIST_M, FINGER_M = 0.06, 0.045
"""Lengths of the wrist, and from the palm to the start of a finger's round tip."""

BOARD_M = np.array([0.07, 0.14, 0.006])  # size of the drawn part of the board, in its own frame
GRIP_M, BLADE_M = np.array([0.02, 0.012, 0.02]), 0.0015
"""Size of the tool between the finger tips, and thickness of its blade."""

EYE_M = 0.16  # from the camera to its target
BOARD, SKIN, SHADOW_OPACITY = "#39424e", "#6b7480", 0.3
"""Colours of board and hand, and opacity of another run's hand and tool in a scene."""

FULL_SCALE_QUANTILE = 0.995
"""Share of the deviations within the colour scale; without it, single electrodes would darken all others."""

MAP_WIDTH, MAP_GAP = 24.0, 3.0  # mm, width of one finger in the flat picture, and gap between both
RATE_HZ = 50.0  # poses, colours and signal samples per second: smooth to the eye; they take up most of a file
HEADINGS = {
    "roll on board": "roll of the tool on the board (degrees; 0 is flat)",
    "hand roll": "roll of the hand (degrees; grey: of the board)",
    "coupling": "coupling term (rad)",
    "cost": "cost: tool off its nominal orientation (rad)",
    "force": "force on the board (N)",
    "torque": "roll torque of the board (mN m)",
}
"""Headings of the plotted signals; cost replaces force where it is known."""


@dataclass(frozen=True)
class Execution:
    """One run on the board, with the feedback's inputs and outputs."""

    look: Look  # name and colour of its kind
    run: Demonstration  # with orientation, joint positions, wrench, tool-to-board orientation and segments
    board_deg: float  # roll of the board
    primitives: Sequence[str]  # names, in the order of `run.true_segments`
    # primitives with feedback: columns `primitive`, `time_s` since its start, `coupling` (rad, about the roll
    # axis) and `channel_00` ... (counts, readings minus those of nominal runs)
    traces: pd.DataFrame
    # (C,) rad, of the first C <= T samples of the run (eq. IV.34); None if it is not shown
    cost: np.ndarray | None = None

    @property
    def kept(self) -> slice:
        """Samples of the run that are shown."""
        return slice(None, None, items.thinning(self.run.dt, RATE_HZ))

    @cached_property
    def felt(self) -> pd.DataFrame:
        """Traces in temporal order (S, ...), with `time_s` since the start of the run."""
        starts = dict(zip(self.primitives, self.run.signal("true_segments")[:, 0], strict=True))
        since_start = self.traces["time_s"] + self.traces["primitive"].map(starts)
        return self.traces.assign(time_s=since_start).sort_values("time_s", kind="stable")

    @property
    def deviation(self) -> np.ndarray:
        """Electrode readings minus those of nominal runs, (S, 38) counts."""
        return self.felt.filter(regex="^channel_").to_numpy(float)

    @property
    def signals(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Plotted signals, keyed as in `HEADINGS`: times (N,) in s, and values (N,)."""
        run, kept, wrench = self.run, self.kept, self.run.signal("wrench")
        before = run.time[:1]  # zero before feedback starts, so that all plots begin together
        signals = {
            "roll on board": (run.time[kept], layout.tool_roll_deg(run)[kept]),
            "hand roll": (run.time[kept], layout.hand_roll_deg(run)[kept]),
            "coupling": (np.append(before, self.felt["time_s"]), np.append(0.0, self.felt["coupling"])),
        }
        if self.cost is None:
            signals["force"] = (run.time[kept], -wrench[kept, 2])
        else:
            signals["cost"] = (run.time[: len(self.cost)][kept], self.cost[kept])
        return signals | {"torque": (run.time[kept], -1e3 * wrench[kept, 3:] @ layout.ROLL_AXIS)}

    def readings(self, path: str, points: rr.Points2D | rr.Points3D, scale: float) -> Item:
        """Electrode colours over time; before feedback starts all are as expected."""
        felt, deviation = self.felt["time_s"].to_numpy(), self.deviation
        kept = items.kept(felt, RATE_HZ)
        shown = np.vstack([np.zeros(deviation.shape[1]), deviation[kept]])
        return items.readings(path, np.append(self.run.time[:1], felt[kept]), points, shown, scale)


def signal_plots(parent: str, executions: Sequence[Execution]) -> list[Panel]:
    """Plots of the signals of executions in one setting, with the board's roll."""
    curves: dict[str, list[Item]] = {kind: [] for kind in executions[0].signals}
    for one in executions:
        for kind, signal in one.signals.items():
            curves[kind].append(items.series(entity(parent, kind, one.look.name), *signal, *one.look))
    level = one.run.time[[0, -1]], np.full(2, one.board_deg)
    curves["hand roll"].append(items.series(entity(parent, "hand roll", "board"), *level, "board", GREY))
    return [views.plot(HEADINGS[kind], its, legend=False) for kind, its in curves.items()]


def scene(path: str, one: Execution, scale: float, shadow: bool = False) -> list[Item]:
    """Board, path, moving hand with its electrodes, and the tool turning between the fingers.

    `scale`: of `full_scale`. `shadow`: only hand and tool, pale and in the run's colour; electrodes would
    hide those of the other hand.
    """
    times, colour, grasp = one.run.time[one.kept], one.look.colour, layout.grasp_place(one.run)[one.kept]
    position, orientation = one.run.position[one.kept], one.run.signal("orientation")[one.kept]
    turned = layout.tool_orientation(one.run, one.board_deg)[one.kept]
    skin, grip, opacity = (colour, colour, SHADOW_OPACITY) if shadow else (SKIN, WHITE, 1.0)
    shown = [
        items.moving_frame(f"{path}/hand", times, position, colour, orientation),
        *hand(f"{path}/hand", skin, opacity),
        items.moving_frame(f"{path}/tool", times, grasp, "", turned),
        *tool(f"{path}/tool", colour, grip, opacity),
    ]
    if shadow:
        return shown
    points = rr.Points3D(electrodes().reshape(-1, 3) - [0.0, 0.0, layout.EDGE_M], radii=0.0008)
    travelled = items.lines(f"{path}/path", [position], colour, -1.0)
    felt = one.readings(f"{path}/hand/electrodes", points, scale)
    return [*shown, board(f"{path}/board", one.board_deg), travelled, felt]


def board(path: str, board_deg: float = 0.0) -> Item:
    """The board, tilted about its axis, with its top at the contact point."""
    turn = rr.Quaternion(xyzw=quaternion.to_xyzw(layout.board_orientation(board_deg)))
    pose = rr.Transform3D(translation=layout.CONTACT_M, quaternion=turn)
    body = items.solid(path, rr.Boxes3D, BOARD, sizes=[BOARD_M], centers=[[0.0, 0.03, -0.5 * BOARD_M[2]]])
    return Item(path, [pose, *body.still])


def hand(path: str, skin: str = SKIN, opacity: float = 1.0) -> list[Item]:
    """Palm and fingers below the entity of the hand's frame, so that they move with it."""
    outwards = 1e-3 * (PAD_DISTANCE_MM + SKIN_RADIUS_MM)
    tips = -layout.EDGE_M - 1e-3 * np.array(HOME_MM)  # start of the round tips along z
    places = [[outwards, 0.0, tips[0] - FINGER_M], [-outwards, 0.0, tips[1] - FINGER_M]]
    fingers = {"lengths": [FINGER_M] * 2, "radii": [1e-3 * SKIN_RADIUS_MM] * 2, "translations": places}
    top, bottom = -layout.EDGE_M - layout.GRASP_M, -layout.EDGE_M - FINGER_M
    sizes = [[0.06, 0.03, bottom - top], [0.04, 0.04, WRIST_M]]
    centres = [[0.0, 0.0, 0.5 * (top + bottom)], [0.0, 0.0, top - 0.5 * WRIST_M]]
    return [
        items.solid(f"{path}/fingers", rr.Capsules3D, skin, 0.4 * opacity, **fingers),
        items.solid(f"{path}/palm", rr.Boxes3D, skin, opacity, sizes=sizes, centers=centres),
    ]


def tool(path: str, colour: str, grip: str = WHITE, opacity: float = 1.0) -> list[Item]:
    """The tool's grip, blade and edge below the entity of the grasp's frame."""
    reached, width, edge = 0.5 * GRIP_M[2], layout.EDGE_WIDTH_M, layout.EDGE_M
    sizes = [GRIP_M, np.array([width, BLADE_M, edge - reached])]
    centres = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * (reached + edge)]]
    ends = [[-0.5 * width, 0.0, edge], [0.5 * width, 0.0, edge]]
    body = items.solid(f"{path}/body", rr.Boxes3D, [grip, colour], opacity, sizes=sizes, centers=centres)
    return [body, items.lines(f"{path}/edge", [ends], colour, -2.5)]


def close_view(name: str, shown: Sequence[Item]) -> Panel:
    """Close 3-D view of the tool on the board along the scraping direction, which shows roll."""
    target = layout.CONTACT_M + np.array([0.0, 0.02, 0.028])
    return views.eye(name, shown, target, EYE_M * np.array([0.15, -0.93, 0.33]))


def full_scale(executions: Sequence[Execution]) -> float:
    """Deviation in counts shown in full colour, common to these executions."""
    deviations = np.abs(np.concatenate([one.deviation for one in executions]))
    return float(np.quantile(deviations, FULL_SCALE_QUANTILE))


def electrodes() -> np.ndarray:
    """Electrode positions (2, 19, 3) m from the grasp in the hand's axes, left finger first.

    A finger's own x points to its tip, z into it, and y along -y of the hand for the left finger.
    """
    along, across, inwards = ELECTRODES_MM.T
    outwards = PAD_DISTANCE_MM + SKIN_RADIUS_MM + inwards
    sides = zip((1.0, -1.0), HOME_MM, strict=True)
    return 1e-3 * np.array([np.stack([s * outwards, -s * across, along - home], -1) for s, home in sides])


def electrode_map(path: str, one: Execution, scale: float) -> Panel:
    """Electrodes of both fingers as flat pictures in mm, seen from the back of each finger.

    The fingers lie side by side with their tips to the right and the scraping direction up.
    """
    offsets = np.array([[0.0, 0.0], [MAP_WIDTH + MAP_GAP, 0.0]])  # of the fingers
    flat = 1e3 * electrodes()[:, :, [2, 1]] * [1.0, -1.0] + offsets[:, None]
    felt = one.readings(path, rr.Points2D(flat.reshape(-1, 2), radii=1.1), scale)
    names = items.texts(
        f"{path}/names", offsets + np.array([-5.0, 6.2]), ["left finger", "right finger"], GREY
    )
    heading = f"{one.look.name}: ±{scale:.0f} counts"
    return views.flat(heading, [felt, names], [-16.0, 2 * MAP_WIDTH + MAP_GAP - 11.0], [-7.0, 11.0])
