"""Arms in recordings: meshes of a URDF, or sticks if it has none, moved by joint positions."""

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import rerun as rr
from rerun.urdf import UrdfTree

from structlearn.readers.urdf_file import robot_element
from structlearn.viewer import views
from structlearn.viewer.items import Item, Times, dots, entity, lines, series
from structlearn.viewer.views import Panel

PACKAGE = "package://"  # prefix of mesh paths in ROS URDFs, resolved relative to the URDF
PARTS = ("link", "joint", "material")  # of a URDF that are shown
STICK_M = 0.025  # radius of a stick


def meshes(
    name: str, urdf: str | Path, joints: Sequence[str], times: Times, positions: np.ndarray
) -> list[Item]:
    """An arm's meshes, moved by joint positions (T, n) rad or m over time; other joints stay at zero.

    `name`: of the arm, without slashes, unique in the recording.
    """
    arm = _read(Path(urdf), name)
    shapes = f"/{name}/{arm.name}/visual_geometries/**"
    shown = arm.stream(include_joint_transforms=False).filter(content=shapes)
    return [Item(shapes, chunks=shown), *_frames(name, arm, joints, times, positions)]


def sticks(
    name: str,
    urdf: str | Path,
    joints: Sequence[str],
    times: Times,
    positions: np.ndarray,
    colours: tuple[str, str],
) -> tuple[list[Item], float]:
    """`meshes` for a URDF without them: a ball at every joint, and sticks between them.

    Also the total length of all sticks in m, an upper bound on the arm's reach.
    """
    arm, shown, length = _read(Path(urdf), name), list[Item](), 0.0
    for joint in arm.joints():
        ends = np.array([[0.0, 0.0, 0.0], joint.origin_xyz])
        length += float(np.linalg.norm(joint.origin_xyz))
        stick = lines(entity(name, "sticks", joint.name), [ends], colours[0], STICK_M)
        ball = dots(entity(name, "balls", joint.name), ends[1:], colours[1], 1.6 * STICK_M)
        shown += [attached(item, name, joint.parent_link) for item in (stick, ball)]
    return [*shown, *_frames(name, arm, joints, times, positions)], length


def attached(item: Item, name: str, link: str) -> Item:
    """An item that moves with a link of the arm of a name."""
    return Item(item.path, [rr.CoordinateFrame(f"{name}/{link}"), *item.still])


def _frames(
    name: str, arm: UrdfTree, joints: Sequence[str], times: Times, positions: np.ndarray
) -> Iterable[Item]:
    # entities without a frame of their own are below the root, so the arm's base is placed there
    base = rr.Transform3D(parent_frame="tf#/", child_frame=f"{arm.frame_prefix}{arm.root_link().name}")
    yield Item(entity(name, "frames", "base"), [base])
    columns = {joint: positions[:, number].tolist() for number, joint in enumerate(joints)}
    for joint in arm.joints():
        path = entity(name, "frames", joint.name)
        if joint.name in columns:
            yield Item(path, (), times, joint.compute_transform_columns(columns[joint.name], clamp=False))
        else:
            yield Item(path, [joint.compute_transform(0.0, clamp=False)])


def arm_scene(title: str, items: Iterable[Item], tool: np.ndarray) -> Panel:
    """3-D view of an arm on its base, whose tool moves along points (N, 3) m."""
    # the arm's own links may extend above and beside its tool
    top = [0.0, 0.0, 1.1 * float(np.linalg.norm(tool, axis=1).max())]
    return views.scene(title, items, np.vstack([1.15 * tool, np.zeros(3), top]))


def _read(urdf: Path, name: str) -> UrdfTree:
    """Read a URDF with frames prefixed by the arm's name; mesh files are searched for beside it.

    rerun gets only what it needs, since it refuses XML prefixes that are not declared, as in sensors.
    """
    root = robot_element(urdf)
    for part in list(root):
        if part.tag not in PARTS:
            root.remove(part)
    for mesh in root.iter("mesh"):
        if "://" not in (file := mesh.get("filename", "").removeprefix(PACKAGE)):
            mesh.set("filename", str(urdf.parent.resolve() / file))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / urdf.name
        ElementTree.ElementTree(root).write(copy, encoding="utf-8")
        return UrdfTree.from_file_path(copy, entity_path_prefix=name, frame_prefix=f"{name}/")


def followed(
    arm: Panel,
    learned: pd.DataFrame,
    time: np.ndarray,
    carried_kg: np.ndarray,
    colours: tuple[str, str, str],
    notes: str,
) -> Panel:
    """An arm beside plots of the payload learned online (`payload.follow_payload`) and the true payload.

    `carried_kg` (T,) at `time` (T,) s; `colours`: of the truth, the learned model and the empty arm's model.
    """
    reference, found, empty = colours
    times = learned["time_s"].to_numpy(float)
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    masses = [
        series("mass/carried", time, carried_kg, "carried", reference, width=3.0),
        series("mass/learned", times, learned["mass_kg"].to_numpy(float), "learned", found),
    ]
    errors = [
        series(entity("error", name), times, np.log10(learned[f"nmse_{name}"].to_numpy(float)), label, colour)
        for name, label, colour in (("fixed", "empty arm", empty), ("learned", "learned online", found))
    ]
    plots = {
        "mass in the hand (kg)": masses,
        "first moment of the mass (kg m)": [series("moment", times, moments, "xyz")],
        "log10 of the NMSE of each batch before it is learned": errors,
    }
    return views.row(
        arm,
        views.column(*views.plots(plots, legend=False), views.notes(notes), shares=[3, 3, 3, 4]),
        shares=[3, 3],
    )
