"""Arms in recordings: the meshes of a URDF, or sticks if it has none, moved by the joints."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
from rerun.urdf import UrdfTree

from structlearn.palette import AXIS_COLOURS
from structlearn.viewer.rrd import entity, plot, rgba, scene_view, send_series, time_column

PACKAGE = "package://"  # prefix of mesh paths in URDFs for ROS, which are read relative to the URDF
STICK_M = 0.025  # radius of a stick


def send_arm(
    stream: rr.RecordingStream,
    name: str,
    urdf: str | Path,
    joints: Sequence[str],
    times: rr.TimeColumn,
    positions: np.ndarray,
) -> None:
    """Log an arm's meshes, and its joints over time, (T, n) rad or m; joints not named stay at zero.

    `name`: of the arm, without slashes, unique in the recording.
    """
    arm = _read(Path(urdf), name)
    shapes = f"/{name}/{arm.name}/visual_geometries/**"
    stream.send_chunks(arm.stream(include_joint_transforms=False).filter(content=shapes))
    _send_joints(stream, name, arm, joints, times, positions)


def send_sticks(
    stream: rr.RecordingStream,
    name: str,
    urdf: str | Path,
    joints: Sequence[str],
    times: rr.TimeColumn,
    positions: np.ndarray,
    colours: tuple[str, str],
) -> float:
    """`send_arm` for a URDF without meshes: a ball at every joint, and sticks between them.

    Returns the length of all sticks in m, a bound on the arm's reach.
    """
    arm = _read(Path(urdf), name)
    length = 0.0
    for joint in arm.joints():
        ends = np.array([[0.0, 0.0, 0.0], joint.origin_xyz])
        length += float(np.linalg.norm(joint.origin_xyz))
        frame = rr.CoordinateFrame(link_frame(name, joint.parent_link))
        stick = rr.LineStrips3D([ends], colors=rgba(colours[:1]), radii=STICK_M)
        ball = rr.Points3D(ends[1:], colors=rgba(colours[1:]), radii=1.6 * STICK_M)
        for kind, shape in (("sticks", stick), ("balls", ball)):
            stream.log(entity(name, kind, joint.name), frame, shape, static=True)
    _send_joints(stream, name, arm, joints, times, positions)
    return length


def link_frame(name: str, link: str) -> str:
    """Frame of an arm's link, for entities fixed to it (`rr.CoordinateFrame`)."""
    return f"{name}/{link}"


def _send_joints(
    stream: rr.RecordingStream,
    name: str,
    arm: UrdfTree,
    joints: Sequence[str],
    times: rr.TimeColumn,
    positions: np.ndarray,
) -> None:
    # entities without their own frame are below the root, so the arm's base is placed there
    base = rr.Transform3D(parent_frame="tf#/", child_frame=f"{arm.frame_prefix}{arm.root_link().name}")
    stream.log(entity(name, "frames", "base"), base, static=True)
    columns = {joint: positions[:, number].tolist() for number, joint in enumerate(joints)}
    for joint in arm.joints():
        path = entity(name, "frames", joint.name)
        if joint.name in columns:
            turned = joint.compute_transform_columns(columns[joint.name], clamp=False)
            stream.send_columns(path, [times], turned)
        else:
            stream.log(path, joint.compute_transform(0.0, clamp=False), static=True)


def arm_contents(name: str) -> str:
    """Query expression for everything that `send_arm` logs."""
    return f"/{name}/**"


def arm_view(title: str, contents: Sequence[str], tool: np.ndarray) -> rrb.Spatial3DView:
    """3-D view of an arm on its base, with the tool's path (N, 3) in m."""
    # the arm's links may be above and beside its tool
    top = [0.0, 0.0, 1.1 * float(np.linalg.norm(tool, axis=1).max())]
    return scene_view(title, contents, np.vstack([1.15 * tool, np.zeros(3), top]))


def _read(urdf: Path, name: str) -> UrdfTree:
    """The URDF with frames prefixed by the arm's name; package meshes are read relative to it."""
    options = {"entity_path_prefix": name, "frame_prefix": f"{name}/"}
    text = urdf.read_text()
    if PACKAGE not in text:
        return UrdfTree.from_file_path(urdf, **options)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / urdf.name
        copy.write_text(text.replace(PACKAGE, f"{urdf.parent.resolve()}/"))
        return UrdfTree.from_file_path(copy, **options)


def send_followed(
    stream: rr.RecordingStream,
    learned: pd.DataFrame,
    time: np.ndarray,
    carried_kg: np.ndarray,
    colours: tuple[str, str, str],
) -> None:
    """Log curves of a payload learned online (`payload.follow_payload`), and the true one.

    `carried_kg` (T,) at `time` (T,) s; `colours`: of the truth, of the learned and of the empty arm's model.
    """
    reference, found, empty = colours
    times = [time_column(learned["time_s"].to_numpy(float))]
    path = entity("mass", "carried")
    send_series(stream, path, [time_column(time)], carried_kg[:, None], ["carried"], [reference], width=3.0)
    mass = learned["mass_kg"].to_numpy(float)[:, None]
    send_series(stream, entity("mass", "learned"), times, mass, ["learned"], [found])
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    send_series(stream, "moment", times, moments, ["x", "y", "z"], AXIS_COLOURS)
    for name, label, colour in (("fixed", "empty arm", empty), ("learned", "learned online", found)):
        error = np.log10(learned[f"nmse_{name}"].to_numpy(float))[:, None]
        send_series(stream, entity("error", name), times, error, [label], [colour])


def followed_plots() -> Sequence[rrb.TimeSeriesView]:
    """Views of what `send_followed` logs."""
    return (
        plot("mass in the hand (kg)", ["/mass/**"], legend=False),
        plot("first moment of the mass (kg m)", ["/moment"], legend=False),
        plot("log10 of the NMSE of each batch before it is learned", ["/error/**"], legend=False),
    )
