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
import rerun.blueprint as rrb

from dissertation.scraping.world import layout
from dissertation.simulation.fingers import HOME_MM, PAD_DISTANCE_MM
from structlearn.core import quaternion
from structlearn.palette import GREY, WHITE, Look
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import ELECTRODES_MM, SKIN_RADIUS_MM
from structlearn.viewer import rrd
from structlearn.viewer.diagram import texts
from structlearn.viewer.rrd import Recording, below

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
        return slice(None, None, rrd.thinning(self.run.dt, RATE_HZ))

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


def send_signals(to: Recording, parent: str, executions: Sequence[Execution]) -> list[rrb.TimeSeriesView]:
    """Log the signals of executions in one setting below a parent, and the board's roll; return the plots."""
    for one in executions:
        for kind, (times, values) in one.signals.items():
            to.series(rrd.entity(parent, kind, one.look.name), times, values, one.look.name, one.look.colour)
    board = rrd.entity(parent, "hand roll", "board")
    to.series(board, one.run.time[[0, -1]], np.full(2, one.board_deg), "board", GREY)
    return [rrd.plot(HEADINGS[kind], [below(parent, kind)], legend=False) for kind in one.signals]


def send_scene(to: Recording, path: str, one: Execution, scale: float, shadow: bool = False) -> None:
    """Log board, path, moving hand with its electrodes, and the tool turning between the fingers.

    `scale`: of `full_scale`. `shadow`: only hand and tool, pale and in the run's colour; electrodes would
    hide those of the other hand.
    """
    times, colour = one.run.time[one.kept], one.look.colour
    position, orientation = one.run.position[one.kept], one.run.signal("orientation")[one.kept]
    opacity = SHADOW_OPACITY if shadow else 1.0
    to.moving_frame(f"{path}/hand", times, position, colour, orientation)
    send_hand(to, f"{path}/hand", colour if shadow else SKIN, opacity)
    pose = rr.Transform3D.columns(
        translation=layout.grasp_place(one.run)[one.kept],
        quaternion=quaternion.to_xyzw(layout.tool_orientation(one.run, one.board_deg)[one.kept]),
    )
    to.over(f"{path}/tool", times, pose)
    send_tool(to, f"{path}/tool", colour, colour if shadow else WHITE, opacity)
    if not shadow:
        send_board(to, f"{path}/board", one.board_deg)
        to.lines(f"{path}/path", [position], colour, -1.0)
        points = rr.Points3D(electrodes().reshape(-1, 3) - [0.0, 0.0, layout.EDGE_M], radii=0.0008)
        _send_readings(to, f"{path}/hand/electrodes", points, one, scale)


def send_board(to: Recording, path: str, board_deg: float = 0.0) -> None:
    """Log the board, tilted about its axis, with its top at the contact point."""
    turn = rr.Quaternion(xyzw=quaternion.to_xyzw(layout.board_orientation(board_deg)))
    to.still(path, rr.Transform3D(translation=layout.CONTACT_M, quaternion=turn))
    to.boxes(path, [BOARD_M], [[0.0, 0.03, -0.5 * BOARD_M[2]]], BOARD)


def send_hand(to: Recording, path: str, skin: str = SKIN, opacity: float = 1.0) -> None:
    """Log palm and fingers below the entity of the hand's frame, so that they move with it."""
    outwards = 1e-3 * (PAD_DISTANCE_MM + SKIN_RADIUS_MM)
    tips = -layout.EDGE_M - 1e-3 * np.array(HOME_MM)  # start of the round tips along z
    places = [[outwards, 0.0, tips[0] - FINGER_M], [-outwards, 0.0, tips[1] - FINGER_M]]
    fingers = {"lengths": [FINGER_M] * 2, "radii": [1e-3 * SKIN_RADIUS_MM] * 2, "translations": places}
    to.solid(f"{path}/fingers", rr.Capsules3D, skin, 0.4 * opacity, **fingers)
    top, bottom = -layout.EDGE_M - layout.GRASP_M, -layout.EDGE_M - FINGER_M
    sizes = [[0.06, 0.03, bottom - top], [0.04, 0.04, WRIST_M]]
    centres = [[0.0, 0.0, 0.5 * (top + bottom)], [0.0, 0.0, top - 0.5 * WRIST_M]]
    to.boxes(f"{path}/palm", sizes, centres, [skin], opacity)


def send_tool(to: Recording, path: str, colour: str, grip: str = WHITE, opacity: float = 1.0) -> None:
    """Log the tool's grip, blade and edge below the entity of the grasp's frame."""
    reached = 0.5 * GRIP_M[2]
    sizes: list[np.ndarray | list[float]] = [GRIP_M, [layout.EDGE_WIDTH_M, BLADE_M, layout.EDGE_M - reached]]
    centres = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * (reached + layout.EDGE_M)]]
    to.boxes(f"{path}/body", sizes, centres, [grip, colour], opacity)
    ends = [[-0.5 * layout.EDGE_WIDTH_M, 0.0, layout.EDGE_M], [0.5 * layout.EDGE_WIDTH_M, 0.0, layout.EDGE_M]]
    to.lines(f"{path}/edge", [ends], colour, -2.5)


def close_view(name: str, contents: Sequence[str]) -> rrb.Spatial3DView:
    """Close 3-D view of the tool on the board along the scraping direction, which shows roll."""
    target = layout.CONTACT_M + np.array([0.0, 0.02, 0.028])
    return rrd.eye_view(name, contents, target, EYE_M * np.array([0.15, -0.93, 0.33]))


def full_scale(executions: Sequence[Execution]) -> float:
    """Deviation in counts shown in full colour, common to these executions."""
    deviations = np.abs(np.concatenate([one.deviation for one in executions]))
    return float(np.quantile(deviations, FULL_SCALE_QUANTILE))


def electrodes() -> np.ndarray:
    """Electrode positions (2, 19, 3) m from the grasp in the hand's axes, left finger first.

    A finger's own x points to its tip, z into it, and y along -y of the hand for the left finger.
    """
    along, across, inwards = ELECTRODES_MM.T
    fingers = []
    for side, home in zip((1.0, -1.0), HOME_MM, strict=True):
        outwards = side * (PAD_DISTANCE_MM + SKIN_RADIUS_MM + inwards)
        fingers.append(np.column_stack([outwards, -side * across, along - home]))
    return 1e-3 * np.array(fingers)


def send_electrode_map(to: Recording, path: str, one: Execution, scale: float) -> rrb.Spatial2DView:
    """Log the electrodes of both fingers as flat pictures in mm, seen from the back of each finger.

    The fingers lie side by side with their tips to the right and the scraping direction up.
    """
    offsets = np.array([[0.0, 0.0], [MAP_WIDTH + MAP_GAP, 0.0]])  # of the fingers
    flat = 1e3 * electrodes()[:, :, [2, 1]] * [1.0, -1.0] + offsets[:, None]
    _send_readings(to, path, rr.Points2D(flat.reshape(-1, 2), radii=1.1), one, scale)
    names = texts(offsets + np.array([-5.0, 6.2]), ["left finger", "right finger"], [GREY])
    to.still(f"{path}/names", names)
    heading = f"{one.look.name}: ±{scale:.0f} counts"
    return rrd.flat_view(heading, path, [-16.0, 2 * MAP_WIDTH + MAP_GAP - 11.0], [-7.0, 11.0])


def _send_readings(
    to: Recording, path: str, points: rr.Points2D | rr.Points3D, one: Execution, scale: float
) -> None:
    """Log electrode colours over time; before feedback starts all are as expected."""
    felt, deviation = one.felt["time_s"].to_numpy(), one.deviation
    kept = slice(None, None, rrd.thinning(float(np.median(np.diff(felt))), RATE_HZ))
    shown = np.vstack([np.zeros(deviation.shape[1]), deviation[kept]])
    to.readings(path, np.append(one.run.time[:1], felt[kept]), points, shown, scale)
