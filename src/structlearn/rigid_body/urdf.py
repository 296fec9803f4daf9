"""URDF files as XML: checks that Pinocchio does not make, joints and hands, writing identified inertias.

Pinocchio 4 reads a link whose `<inertial>` is absent or incomplete as massless, keeps negative masses, reads
absent limits as [0, 0] and keeps zero axes. Dynamics of such a robot are singular or wrong, without an error.
"""

import os
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.foreign_tables import natural_order
from structlearn.readers.urdf_file import INERTIA_ENTRIES, LIMITS, check_limits, robot_element

if TYPE_CHECKING:
    from structlearn.rigid_body.tree import KinematicTree, LinkInertias

MOVING = ("revolute", "continuous", "prismatic")


def check_urdf(path: str | Path, locked: Sequence[str]) -> None:
    """Raise InputError unless every joint has one degree of freedom and limits, see `read_urdf`.

    Limits of velocity and effort may be 0, which many files write for none; see `require_velocities`.
    """
    root = robot_element(Path(path))
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    moving = {name: joint for name, joint in joints.items() if joint.get("type") != "fixed"}
    for name in locked:
        if name not in moving:
            raise InputError(f"{path}: there is no moving joint '{name}' to lock")
        if list(locked).count(name) > 1:
            raise InputError(f"{path}: joint '{name}' is to be locked twice")
    for name, joint in moving.items():
        _check_joint(joint, f"{path}: joint '{name}'")
        if joint.find("mimic") is not None and name not in locked:
            raise InputError(
                f"{path}: joint '{name}': it follows another one (<mimic>), so it has to be named in "
                "`locked_joints`, or after --lock"
            )
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None:
            _check_inertial(inertial, f"{path}: link '{link.get('name')}'")


def _check_joint(joint: ElementTree.Element, where: str) -> None:
    kind = joint.get("type")
    if kind not in MOVING:
        raise InputError(f"{where}: type '{kind}' is not supported, only {', '.join(MOVING)} and fixed")
    axis = joint.find("axis")
    if axis is not None and not any(map(float, axis.get("xyz", "").split())):
        raise InputError(f"{where}: the axis is zero")
    limit = joint.find("limit")
    given = {} if limit is None else {key: float(limit.get(key, "")) for key in LIMITS if key in limit.attrib}
    for key in ("velocity", "effort"):
        if given.get(key, 0.0) < 0.0:
            raise InputError(f"{where}: {key} limit {given[key]:g} is negative")
    if kind == "continuous":
        return
    if absent := [key for key in LIMITS if key not in given]:
        raise InputError(f"{where}: <limit> lacks {', '.join(absent)}")
    if kind == "revolute":
        check_limits(where, given["lower"], given["upper"])
    if given["lower"] >= given["upper"]:
        raise InputError(
            f"{where}: lower limit {given['lower']:g} is not below the upper limit {given['upper']:g}"
        )


def _check_inertial(inertial: ElementTree.Element, where: str) -> None:
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise InputError(f"{where}: <inertial> lacks <{'mass' if mass is None else 'inertia'}>")
    for element, names in ((mass, ("value",)), (inertia, INERTIA_ENTRIES)):
        if absent := [name for name in names if name not in element.attrib]:
            raise InputError(f"{where}: <{element.tag}> lacks {', '.join(absent)}")
    if (value := float(mass.get("value", ""))) < 0.0:
        raise InputError(f"{where}: mass {value:g} kg is negative")


def require_velocities(path: str | Path, tree: "KinematicTree") -> None:
    """Raise InputError if a joint has no velocity limit, which motion that is planned or checked needs."""
    for name, velocity in zip(tree.names, tree.velocity, strict=True):
        if velocity <= 0.0:
            raise InputError(f"{path}: joint '{name}': velocity limit {velocity:g} is not positive")


def mesh_folders(path: Path) -> list[Path]:
    """Folders in which a URDF's meshes are searched for: its own, those above it, and ROS_PACKAGE_PATH."""
    packages = [Path(path) for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
    return [*path.resolve().parents, *packages]


def named_files(path: Path) -> dict[str, Path]:
    """Files that a URDF names, such as meshes, by name as written; those that are not found are left out.

    Names may begin with package://, model:// or file://. Raises InputError: it is no URDF.
    """
    names = [element.get("filename") for element in robot_element(path).iter()]
    places = [
        (name, folder / name.rpartition("://")[2])
        for name in dict.fromkeys(names)
        if name
        for folder in mesh_folders(path)
    ]
    return {name: place for name, place in reversed(places) if place.is_file()}  # the first folder counts


HANDS = re.compile(r"tcp|tool|grasp|gripper|hand|ee$|end_?effector|flange", re.IGNORECASE)
"""Usual names of a hand's links and frames."""


def moving_joints(path: str | Path) -> list[str]:
    """Names of all joints that are not fixed, in file order. Raises InputError if it is no URDF."""
    return [name for name, (kind, _, _) in _joints(path).items() if kind != "fixed"]


def moved_link(path: str | Path, joint: str) -> str:
    """Name of the link that a joint of a URDF moves."""
    return _joints(path)[joint][2]


def tips(path: str | Path, joints: Collection[str]) -> list[str]:
    """Links at the ends of the chains that some joints move, the most likely hand first.

    Links named like a hand come first, then those behind more joints. Links moved by other joints, e.g.
    fingers, are left out. Raises InputError: the file is missing or no URDF.
    """
    chains = _chains(path)
    depths = {link: len(chain) for link, chain in chains.items() if chain and set(chain) <= set(joints)}
    inner = {parent for _, parent, child in _joints(path).values() if child in depths}
    return sorted(depths.keys() - inner, key=lambda link: (not HANDS.search(link), -depths[link], link))


def counterparts(path: str | Path, joints: Sequence[str]) -> dict[str, str]:
    """Map recorded joint names to a URDF's, if one of its chains has as many joints, numbered alike.

    Joints are matched by the numbers at the ends of their names: `fer_joint1` is `panda_joint1`. Empty if no
    chain fits.
    """
    wanted, chains = sorted(joints, key=natural_order), _chains(path)
    numbers = list(map(_number, wanted))
    for tip in tips(path, moving_joints(path)):
        if None not in numbers and list(map(_number, chains[tip])) == numbers:
            return dict(zip(wanted, chains[tip], strict=True))
    return {}


def _number(name: str) -> str | None:
    digits = re.search(r"\d+$", name)
    return digits and digits.group()


def _chains(path: str | Path) -> dict[str, list[str]]:
    """Names of the joints that move each link, from the root on; links on a cycle are left out."""
    carried = {child: (name, kind, parent) for name, (kind, parent, child) in _joints(path).items()}
    chains = {}
    for link in carried:
        chain, at, passed = list[str](), link, set[str]()
        while at in carried and at not in passed:
            passed.add(at)
            name, kind, at = carried[at]
            chain += [name] if kind != "fixed" else []
        chains[link] = chain[::-1]
    return chains


def _joints(path: str | Path) -> dict[str, tuple[str, str, str]]:
    """Kind, parent and child link of every joint."""
    by_name = {}
    for joint in robot_element(Path(path)).findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            raise InputError(f"{path}: joint '{joint.get('name')}' has no parent or no child")
        by_name[joint.get("name", "")] = (
            joint.get("type", ""),
            parent.get("link", ""),
            child.get("link", ""),
        )
    if not by_name:
        raise InputError(f"{path}: not a URDF of a robot: it has no joints")
    return by_name


def write_urdf(
    source: str | Path,
    target: str | Path,
    tree: "KinematicTree",
    inertias: "LinkInertias[np.ndarray]",
    viscous: np.ndarray | None = None,
    coulomb: np.ndarray | None = None,
) -> None:
    """Write a robot with identified inertias and friction as a URDF. The caller publishes the file.

    The identified inertia of a link includes whatever is fixed to it, or was locked when the file was read.
    Inertias of those parts become zero, explicitly, since simulators assume 1 kg for links without one. Mesh
    shapes are left out: PyBullet refuses a robot whose meshes are not beside the file.

    Args:
        source: the URDF that `tree` was read from; joints that the tree lacks become fixed.
        target: the file to write; its folder exists.
        tree: n joints.
        inertias: mass (n,) positive, of each moving link including what is fixed to it.
        viscous: (n,) N m s/rad, written as `damping`; None: as in the source.
        coulomb: (n,) N m, written as `friction`; None: as in the source.

    Raises:
        InputError: a joint of the tree is not in the source.
    """
    root, ends, chains = robot_element(Path(source)), _joints(source), _chains(source)
    if missing := [name for name in tree.names if name not in ends]:
        raise InputError(f"{source}: lacks the joints {', '.join(missing)}")
    moved = {ends[name][2]: place for place, name in enumerate(tree.names)}
    for link in root.findall("link"):
        name, old = link.get("name", ""), link.find("inertial")
        _without_meshes(link)
        if old is not None and not set(tree.names) & set(chains.get(name, ())):
            continue  # links that do not move were not identified
        if old is not None:
            link.remove(old)
        link.append(_inertial(inertias, moved.get(name)))
    for joint in root.findall("joint"):
        if joint.get("name") not in tree.names:
            joint.set("type", "fixed")
            continue
        for key, values in (("damping", viscous), ("friction", coulomb)):
            if values is not None:
                dynamics = joint.find("dynamics")
                if dynamics is None:
                    dynamics = ElementTree.SubElement(joint, "dynamics")
                dynamics.set(key, repr(float(values[tree.names.index(joint.get("name", ""))])))
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(target, encoding="utf-8", xml_declaration=True)


def _without_meshes(link: ElementTree.Element) -> None:
    for kind in ("visual", "collision"):
        for shape in link.findall(kind):
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)


def _inertial(inertias: "LinkInertias[np.ndarray]", place: int | None) -> ElementTree.Element:
    """`<inertial>` of a moving link, with all digits; zeros if `place` is None."""
    mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    if place is not None:
        mass, inertia = float(inertias.mass[place]), inertias.inertia[place]
        centre = inertias.first_moment[place] / mass
    element = ElementTree.Element("inertial")
    ElementTree.SubElement(element, "origin", xyz=" ".join(map(repr, centre.tolist())), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=repr(mass))
    values = {name: repr(float(inertia[entry])) for name, entry in INERTIA_ENTRIES.items()}
    ElementTree.SubElement(element, "inertia", values)
    return element
