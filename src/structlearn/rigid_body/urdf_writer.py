"""Identified inertias and friction as a URDF, from the tree of the file that the kinematics came from.

What is fixed to a link, or was locked when the file was read, is part of what was identified: its own inertia
becomes zero, written out, since simulators take a link without one for 1 kg. Shapes from mesh files are left
out: the files lie beside the source, and PyBullet refuses a robot whose meshes it does not find.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from structlearn.core.errors import InputError
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def write_urdf(
    source: str | Path,
    target: str | Path,
    tree: KinematicTree,
    inertias: LinkInertias[np.ndarray],
    viscous: np.ndarray | None = None,
    coulomb: np.ndarray | None = None,
) -> None:
    """Write a robot with other inertias than its source has. The caller publishes the file.

    Args:
        source: the URDF that `tree` was read from; joints that are not among the tree's become fixed.
        target: the file to write; its folder exists.
        tree: n joints.
        inertias: mass (n,) positive, of each moving link with what is fixed to it.
        viscous: (n,) N m s/rad, joints' `damping`; None: as in the source.
        coulomb: (n,) N m, joints' `friction`; None: as in the source.

    Raises:
        InputError: a joint of the tree is not in the source.
    """
    root = ElementTree.parse(source).getroot()
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    if missing := [name for name in tree.names if name not in joints]:
        raise InputError(f"{source}: lacks the joints {', '.join(missing)}")
    links = {link.get("name"): link for link in root.findall("link")}
    moved: dict[str | None, int] = {
        _end(joints[name], "child"): place for place, name in enumerate(tree.names)
    }
    base = _fixed_to_base(root, joints, tree.names)
    for name, link in links.items():
        _without_meshes(link)
        if name in base and link.find("inertial") is not None:
            continue  # nothing can be learned of what does not move
        old = link.find("inertial")
        if old is not None:
            link.remove(old)
        link.append(_inertial(inertias, moved.get(name)))
    for name, joint in joints.items():
        if name not in tree.names:
            joint.set("type", "fixed")
    for place, name in enumerate(tree.names):
        _set_friction(joints[name], viscous, coulomb, place)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(target, encoding="utf-8", xml_declaration=True)


def _end(joint: ElementTree.Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _fixed_to_base(
    root: ElementTree.Element, joints: dict[str | None, ElementTree.Element], moving: tuple[str, ...]
) -> set[str]:
    """Links that no joint moves."""
    parents = {_end(joint, "child"): (name, _end(joint, "parent")) for name, joint in joints.items()}

    def moves(link: str) -> bool:
        while link in parents:
            name, link = parents[link]
            if name in moving:
                return True
        return False

    return {name for link in root.findall("link") if not moves(name := link.get("name", ""))}


def _without_meshes(link: ElementTree.Element) -> None:
    for kind in ("visual", "collision"):
        for shape in link.findall(kind):
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)


def _inertial(inertias: LinkInertias[np.ndarray], place: int | None) -> ElementTree.Element:
    """Of one of the moving links; of nothing where there is no place. Numbers keep all their digits."""
    mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    if place is not None:
        mass, inertia = float(inertias.mass[place]), inertias.inertia[place]
        centre = inertias.first_moment[place] / mass
    element = ElementTree.Element("inertial")
    ElementTree.SubElement(element, "origin", xyz=" ".join(map(repr, centre.tolist())), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=repr(mass))
    values = {name: repr(float(inertia[entry])) for name, entry in ENTRIES.items()}
    ElementTree.SubElement(element, "inertia", values)
    return element


def _set_friction(
    joint: ElementTree.Element, viscous: np.ndarray | None, coulomb: np.ndarray | None, place: int
) -> None:
    found = {
        name: values for name, values in (("damping", viscous), ("friction", coulomb)) if values is not None
    }
    if not found:
        return
    dynamics = joint.find("dynamics")
    if dynamics is None:
        dynamics = ElementTree.SubElement(joint, "dynamics")
    for name, values in found.items():
        dynamics.set(name, repr(float(values[place])))
