"""Recording of one execution by the whole robot: arm, hand, tool and board, with the signals of the run."""

from pathlib import Path

import numpy as np
import pybullet_data
import rerun.blueprint as rrb

from structlearn.palette import SKY, primitive_colour
from structlearn.testbeds.scraping.recordings.finger_electrodes import (
    full_scale,
    map_view,
    send_electrode_map,
)
from structlearn.testbeds.scraping.recordings.scraping_scene import (
    close_view,
    send_board,
    send_hand,
    send_path,
    send_tool,
)
from structlearn.testbeds.scraping.recordings.shown_execution import (
    Execution,
    send_board_roll,
    send_signals,
    signal_plots,
)
from structlearn.testbeds.scraping.world.layout import CONTACT_M
from structlearn.viewer.arm_meshes import arm_contents, send_arm
from structlearn.viewer.rrd import (
    entity,
    layout,
    origin_label,
    plot,
    recording,
    send_series,
    time_column,
)

URDF = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
"""Of the arm with its meshes, among the data that PyBullet brings."""

JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))
"""Of the columns of joint positions."""

RATE_HZ = 50.0
"""Poses per second: smooth to the eye."""

ARM, RUN = "arm", "run"
"""Entities of the arm and of everything else."""


def write_robot(path: str | Path, one: Execution, title: str = "Robot") -> None:
    """Write an execution by the robot as a recording.

    Args:
        path: of the .rrd file.
        one: the execution.
        title: heading, different for every recording.

    Raises:
        ValueError: the run has no joint positions, or not as many as the arm has joints.
    """
    angles = one.run.joint_positions
    if angles is None or angles.shape[1] != len(JOINTS):
        raise ValueError(f"{one.run.name}: needs the positions of {len(JOINTS)} joints")
    scale = full_scale([one])
    kept = slice(None, None, max(1, round(1.0 / (RATE_HZ * one.run.dt))))
    times = time_column(one.run.time[kept])
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(one, f"{title}{origin_label([one.run])}", scale))
        send_arm(stream, ARM, URDF, JOINTS, times, angles[kept])
        send_board(stream, entity(RUN, "board"), one.board_deg)
        send_path(stream, entity(RUN, "path"), one, kept, SKY)
        send_hand(stream, entity(RUN, "hand"), one, kept, SKY, scale)
        send_tool(stream, entity(RUN, "tool"), one, kept, SKY)
        send_electrode_map(stream, "electrodes", one, scale)
        send_signals(stream, RUN, one, kept, SKY)
        send_board_roll(stream, RUN, one)
        names = [f"joint {number + 1}" for number in range(len(JOINTS))]
        colours = [primitive_colour(number) for number in range(len(JOINTS))]
        moved = np.degrees(angles[kept] - angles[0])
        send_series(stream, "joints", [times], moved, names, colours)


def _blueprint(one: Execution, heading: str, scale: float) -> rrb.Blueprint:
    shown = [f"/{RUN}/{part}/**" for part in ("board", "path", "hand", "tool")]
    left = _whole_view(heading, [arm_contents(ARM), *shown])
    middle = rrb.Vertical(
        close_view(f"board at {one.board_deg:g} degrees", shown),
        map_view(f"±{scale:.0f} counts, blue is below expected", "electrodes"),
        row_shares=[3, 2],
    )
    right = rrb.Vertical(
        *signal_plots(RUN), plot("joints since the start (degrees)", ["/joints"], legend=False)
    )
    return layout(rrb.Horizontal(left, middle, right, column_shares=[6, 4, 4]))


def _whole_view(name: str, contents: list[str]) -> rrb.Spatial3DView:
    """3-D view of the arm from the side that the tool does not turn to."""
    target = np.array([0.57 * CONTACT_M[0], 0.0, 0.4])
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + 1.3 * np.array([0.45, -0.85, 0.3]),
        look_target=target,
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(name=name, origin="/", contents=contents, eye_controls=eye, line_grid=False)
