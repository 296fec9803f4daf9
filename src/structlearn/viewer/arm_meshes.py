"""Arms in recordings: meshes of a URDF, or sticks if it has none, moved by joint positions."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
from rerun.urdf import UrdfTree

from structlearn.viewer.rrd import Recording, Times, dots, entity, lines, notes_view, plot, scene_view

PACKAGE = "package://"  # prefix of mesh paths in ROS URDFs, resolved relative to the URDF
STICK_M = 0.025  # radius of a stick


def send_arm(
    to: Recording, name: str, urdf: str | Path, joints: Sequence[str], times: Times, positions: np.ndarray
) -> None:
    """Log an arm's meshes, and joint positions (T, n) rad or m over time; other joints stay at zero.

    `name`: of the arm, without slashes, unique in the recording.
    """
    arm = _read(Path(urdf), name)
    shapes = f"/{name}/{arm.name}/visual_geometries/**"
    to.send_chunks(arm.stream(include_joint_transforms=False).filter(content=shapes))
    _send_joints(to, name, arm, joints, times, positions)


def send_sticks(
    to: Recording,
    name: str,
    urdf: str | Path,
    joints: Sequence[str],
    times: Times,
    positions: np.ndarray,
    colours: tuple[str, str],
) -> float:
    """`send_arm` for a URDF without meshes: a ball at every joint, and sticks between them.

    Returns the total length of all sticks in m, an upper bound on the arm's reach.
    """
    arm = _read(Path(urdf), name)
    length = 0.0
    for joint in arm.joints():
        ends = np.array([[0.0, 0.0, 0.0], joint.origin_xyz])
        length += float(np.linalg.norm(joint.origin_xyz))
        frame = rr.CoordinateFrame(link_frame(name, joint.parent_link))
        to.still(entity(name, "sticks", joint.name), frame, lines([ends], colours[0], STICK_M))
        to.still(entity(name, "balls", joint.name), frame, dots(ends[1:], colours[1], 1.6 * STICK_M))
    _send_joints(to, name, arm, joints, times, positions)
    return length


def link_frame(name: str, link: str) -> str:
    """Name of a link's frame, for attaching entities to it (`rr.CoordinateFrame`)."""
    return f"{name}/{link}"


def _send_joints(
    to: Recording, name: str, arm: UrdfTree, joints: Sequence[str], times: Times, positions: np.ndarray
) -> None:
    # entities without a frame of their own are below the root, so the arm's base is placed there
    base = rr.Transform3D(parent_frame="tf#/", child_frame=f"{arm.frame_prefix}{arm.root_link().name}")
    to.still(entity(name, "frames", "base"), base)
    columns = {joint: positions[:, number].tolist() for number, joint in enumerate(joints)}
    for joint in arm.joints():
        path = entity(name, "frames", joint.name)
        if joint.name in columns:
            turned = joint.compute_transform_columns(columns[joint.name], clamp=False)
            to.over(path, times, turned)
        else:
            to.still(path, joint.compute_transform(0.0, clamp=False))


def arm_contents(name: str) -> str:
    """Query expression for everything that `send_arm` logs."""
    return f"/{name}/**"


def arm_view(title: str, contents: Sequence[str], tool: np.ndarray) -> rrb.Spatial3DView:
    """3-D view of an arm on its base, whose tool moves along points (N, 3) m."""
    # the arm's own links may extend above and beside its tool
    top = [0.0, 0.0, 1.1 * float(np.linalg.norm(tool, axis=1).max())]
    return scene_view(title, contents, np.vstack([1.15 * tool, np.zeros(3), top]))


def _read(urdf: Path, name: str) -> UrdfTree:
    """Read a URDF with frames prefixed by the arm's name; package meshes are resolved relative to it."""
    options = {"entity_path_prefix": name, "frame_prefix": f"{name}/"}
    text = urdf.read_text()
    if PACKAGE not in text:
        return UrdfTree.from_file_path(urdf, **options)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / urdf.name
        copy.write_text(text.replace(PACKAGE, f"{urdf.parent.resolve()}/"))
        return UrdfTree.from_file_path(copy, **options)


def send_followed(
    to: Recording,
    learned: pd.DataFrame,
    time: np.ndarray,
    carried_kg: np.ndarray,
    colours: tuple[str, str, str],
) -> None:
    """Log the payload learned online (`payload.follow_payload`) and the true payload.

    `carried_kg` (T,) at `time` (T,) s; `colours`: of the truth, the learned model and the empty arm's model.
    """
    reference, found, empty = colours
    times = learned["time_s"].to_numpy(float)
    to.series("mass/carried", time, carried_kg, "carried", reference, width=3.0)
    to.series("mass/learned", times, learned["mass_kg"].to_numpy(float), "learned", found)
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    to.series("moment", times, moments, "xyz")
    for name, label, colour in (("fixed", "empty arm", empty), ("learned", "learned online", found)):
        error = np.log10(learned[f"nmse_{name}"].to_numpy(float))
        to.series(entity("error", name), times, error, label, colour)


def followed_view(arm: rrb.Spatial3DView) -> rrb.Container:
    """An arm beside the plots of what `send_followed` logs, and notes."""
    plots = (
        plot("mass in the hand (kg)", ["/mass/**"], legend=False),
        plot("first moment of the mass (kg m)", ["/moment"], legend=False),
        plot("log10 of the NMSE of each batch before it is learned", ["/error/**"], legend=False),
    )
    right = rrb.Vertical(*plots, notes_view(), row_shares=[3, 3, 3, 4])
    return rrb.Horizontal(arm, right, column_shares=[3, 3])
