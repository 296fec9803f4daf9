"""Names in a URDF, without the robot: which joints move, and which links a hand may be."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from pathlib import Path

from structlearn.ground.errors import InputError

HANDS = re.compile(r"tcp|tool|grasp|gripper|hand|ee$|end_?effector|flange", re.IGNORECASE)
"""What links and frames of a hand are mostly called."""


def moving_joints(path: str | Path) -> list[str]:
    """Names of all joints that are not fixed, in the order of the file.

    Raises:
        InputError: the file is missing or no URDF.
    """
    return [name for name, (kind, _, _) in _joints(path).items() if kind != "fixed"]


def tips(path: str | Path, joints: Collection[str]) -> list[str]:
    """Links at the ends of what some joints move, the likeliest for the hand first.

    Args:
        path: the URDF file.
        joints: names of those whose positions are known; what others move is left out, e.g. fingers.

    Returns:
        Links that carry none of the others: those called like a hand first, then those behind more joints.

    Raises:
        InputError: the file is missing or no URDF.
    """
    found = _joints(path)
    carried = {child: (name, kind, parent) for name, (kind, parent, child) in found.items()}
    depths: dict[str, int] = {}
    for link in carried:
        depth, at, passed = 0, link, set()
        while at in carried and at not in passed:  # a circle of links has no root
            passed.add(at)
            name, kind, at = carried[at]
            if kind != "fixed" and name not in joints:
                depth = 0
                break
            depth += kind != "fixed"
        if depth:
            depths[link] = depth
    inner = {carried[link][2] for link in depths}
    return sorted(depths.keys() - inner, key=lambda link: (not HANDS.search(link), -depths[link], link))


def _joints(path: str | Path) -> dict[str, tuple[str, str, str]]:
    """Kind, parent and child link of every joint."""
    try:
        root = ElementTree.parse(path).getroot()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such URDF file") from error
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: cannot be read as a URDF: {error}") from error
    found = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            raise InputError(f"{path}: joint '{joint.get('name')}' has no parent or no child")
        found[joint.get("name", "")] = (joint.get("type", ""), parent.get("link", ""), child.get("link", ""))
    if not found:
        raise InputError(f"{path}: not a URDF of a robot: it has no joints")
    return found
