"""The scraping testbed in recordings: the tilted board, the hand that pinches the tool, and what it feels.

Frames as in the simulation, all with x along the pinch, y along the scraping direction and z along the
fingers: `hand` is the recorded frame, where the tool's edge is while nothing pulls at it; the grasp lies
between the finger tips, and the tool turns about it.
"""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.palette import LIGHT_GREY
from structlearn.simulation.fingers import TouchParameters
from structlearn.tactile.electrodes import SKIN_RADIUS_MM
from structlearn.testbeds.scraping.recordings.finger_electrodes import electrodes, send_colours
from structlearn.testbeds.scraping.recordings.shown_execution import Execution
from structlearn.testbeds.scraping.world.layout import CONTACT_M, EDGE_M, EDGE_WIDTH_M, GRASP_M, ROLL_AXIS
from structlearn.viewer.rrd import rgba, send_moving_frame, time_column

WRIST_M = 0.06
"""From the end of the arm to the hand's root."""

BOARD_M = np.array([0.07, 0.14, 0.006])
"""Size of the board's part that is drawn, in its own frame."""

GRIP_M = np.array([0.02, 0.012, 0.02])
"""Size of the tool between the finger tips."""

BLADE_M = 0.0015
"""Thickness of the tool's blade."""

FINGER_M = 0.045
"""From the palm to the start of a finger's round tip."""

AXES_M = 0.02
"""Length of the axes of the hand's frame."""

EYE_M = 0.16
"""From the camera to what it looks at."""

BOARD, SKIN = "#39424e", "#6b7480"
"""Colours of the board and of the hand."""

SHADOW_OPACITY = 0.3
"""Of what is drawn pale, in the scene of another execution."""


def send_board(stream: rr.RecordingStream, path: str, board_deg: float) -> None:
    """Log the board, tilted about its axis, with its top where the tool meets it."""
    orientation = quaternion.from_rotation_vector(np.radians(board_deg) * ROLL_AXIS)
    pose = rr.Transform3D(translation=CONTACT_M, quaternion=quaternion.to_xyzw(orientation))
    stream.log(path, pose, static=True)
    box = rr.Boxes3D(
        sizes=[BOARD_M],
        centers=[[0.0, 0.03, -0.5 * BOARD_M[2]]],
        colors=rgba([BOARD]),
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(path, box, static=True)


def send_hand(
    stream: rr.RecordingStream,
    path: str,
    one: Execution,
    kept: slice,
    colour: str,
    scale: float,
    shadow: bool = False,
) -> None:
    """Log the moving hand: its frame, palm, fingers, and electrodes coloured by their deviation.

    Args:
        stream: of the recording.
        path: of the hand's entity.
        one: the execution.
        kept: samples that are shown.
        colour: of the point at the frame's origin, and of a whole shadow.
        scale: of `full_scale`.
        shadow: draw it pale and without its electrodes, which would hide those of another hand.
    """
    times = [time_column(one.run.time[kept])]
    position, orientation = one.run.position[kept], one.run.orientation[kept]
    send_moving_frame(stream, path, times, position, orientation, colour, AXES_M)
    skin, opacity = (colour, SHADOW_OPACITY) if shadow else (SKIN, 1.0)
    touch = TouchParameters()
    outwards = 1e-3 * (touch.pad_distance_mm + SKIN_RADIUS_MM)
    tips = -EDGE_M - 1e-3 * np.array(touch.home_mm)  # where the round tips start, along z
    fingers = rr.Capsules3D(
        lengths=[FINGER_M] * 2,
        radii=[1e-3 * SKIN_RADIUS_MM] * 2,
        translations=[[outwards, 0.0, tips[0] - FINGER_M], [-outwards, 0.0, tips[1] - FINGER_M]],
        colors=rgba([skin], 0.4 * opacity),
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(f"{path}/fingers", fingers, static=True)
    top, bottom = -EDGE_M - GRASP_M, -EDGE_M - FINGER_M
    palm = rr.Boxes3D(
        sizes=[[0.06, 0.03, bottom - top], [0.04, 0.04, WRIST_M]],
        centers=[[0.0, 0.0, 0.5 * (top + bottom)], [0.0, 0.0, top - 0.5 * WRIST_M]],
        colors=rgba([skin], opacity),
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(f"{path}/palm", palm, static=True)
    if shadow:
        return
    points = rr.Points3D(electrodes().reshape(-1, 3) - [0.0, 0.0, EDGE_M], radii=0.0008)
    stream.log(f"{path}/electrodes", points, static=True)
    send_colours(stream, f"{path}/electrodes", rr.Points3D, one, scale)


def send_tool(
    stream: rr.RecordingStream, path: str, one: Execution, kept: slice, colour: str, shadow: bool = False
) -> None:
    """Log the tool as it turns between the fingers: what they hold of it, its blade, and its edge.

    A shadow is pale and has the colour all over.
    """
    opacity = SHADOW_OPACITY if shadow else 1.0
    pose = rr.Transform3D.columns(
        translation=one.grasp[kept], quaternion=quaternion.to_xyzw(one.tool_orientation[kept])
    )
    stream.send_columns(path, [time_column(one.run.time[kept])], pose)
    reached = 0.5 * GRIP_M[2]
    boxes = rr.Boxes3D(
        sizes=[GRIP_M, [EDGE_WIDTH_M, BLADE_M, EDGE_M - reached]],
        centers=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * (reached + EDGE_M)]],
        colors=rgba([colour if shadow else LIGHT_GREY, colour], opacity),
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(f"{path}/body", boxes, static=True)
    ends = [[-0.5 * EDGE_WIDTH_M, 0.0, EDGE_M], [0.5 * EDGE_WIDTH_M, 0.0, EDGE_M]]
    stream.log(f"{path}/edge", rr.LineStrips3D([ends], colors=rgba([colour]), radii=-2.5), static=True)


def send_path(stream: rr.RecordingStream, path: str, one: Execution, kept: slice, colour: str) -> None:
    """Log where the hand's frame goes in the whole run."""
    strip = rr.LineStrips3D([one.run.position[kept]], colors=rgba([colour]), radii=-1.0)
    stream.log(path, strip, static=True)


def close_view(name: str, contents: Sequence[str], distance_m: float = EYE_M) -> rrb.Spatial3DView:
    """3-D view along the scraping direction, close to where the tool meets the board, that shows roll."""
    target = CONTACT_M + np.array([0.0, 0.02, 0.028])
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + distance_m * np.array([0.15, -0.93, 0.33]),
        look_target=target,
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        name=name, origin="/", contents=list(contents), eye_controls=eye, line_grid=False
    )
