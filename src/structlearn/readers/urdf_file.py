"""URDF files: read as XML without namespaces, with all numbers checked, and as Pinocchio's model.

Pinocchio's parser leaves out an inertia or a collision shape with a number that it cannot read, e.g. `1,57`,
without an error: a robot loses the mass of its tool. It gets the XML that was checked, not the file.
"""

import math
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from structlearn.core.errors import InputError
from structlearn.core.used_files import require_file
from structlearn.readers.joint_streams import MOST_JOINTS

INERTIA_ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
LIMITS = ("lower", "upper", "velocity", "effort")

NUMBERS: dict[str, dict[str, int]] = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(LIMITS, 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "calibration": {"rising": 1, "falling": 1},
    "safety_controller": {
        "k_velocity": 1, "k_position": 1, "soft_lower_limit": 1, "soft_upper_limit": 1,
    },
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA_ENTRIES, 1),
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}  # fmt: skip
"""How many numbers attributes of links and joints have, by element."""

SHAPES = ("visual", "collision")  # are not needed for dynamics

# rad: limits beyond the first are in degrees, beyond the second none are meant
LIMITS_IN_DEGREES = (8.0 * math.pi, 720.0)

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def urdf_path(name: str) -> Path:
    """Path of a file, or, where `pybullet_data` is installed, of its file such as `kuka_iiwa/model.urdf`.

    Raises InputError: there is neither.
    """
    packaged = find_spec("pybullet_data")
    folders = packaged.submodule_search_locations if packaged else None
    for path in (Path(name), *(Path(folder, name) for folder in folders or ())):
        if path.is_file():
            return path
    raise InputError(f"urdf: there is no file '{name}', and none of that name in pybullet_data")


def robot_element(path: Path) -> ElementTree.Element:
    """Root element of a URDF; names with an XML prefix stand as written, declared or not.

    Raises InputError: missing, no URDF, a xacro file that is not expanded, or an attribute of a link or joint
    that is not made of numbers.
    """
    try:
        require_file(path)
        root = _without_namespaces(path.read_bytes())
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: no such URDF file: {error.strerror}") from error
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter two for encodings
        raise InputError(f"{path}: not an XML file: {error}") from error
    if root.tag != "robot":
        raise InputError(f"{path}: not a URDF file: its root is <{root.tag}>, not <robot>")
    if (count := len(root.findall("joint"))) > MOST_JOINTS:
        raise InputError(f"{path}: has {count} joints, more than {MOST_JOINTS}")
    for element in root.iter():
        if "xacro" in element.tag:
            raise InputError(f"{path}: has <{element.tag}>: expand it first: xacro FILE > robot.urdf")
    for part in (*root.findall("link"), *root.findall("joint")):
        for element in part:
            if element.tag not in SHAPES:
                check_numbers(element, f"{path}: {part.tag} '{part.get('name')}'")
    return root


def pinocchio_model(path: Path) -> Any:
    """Pinocchio's model of a URDF with a fixed base. Raises InputError: as `robot_element`, or no model."""
    import pinocchio  # takes half a second

    try:
        return pinocchio.buildModelFromXML(ElementTree.tostring(robot_element(path), encoding="unicode"))
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: not a valid URDF model; its parser has printed why") from error


def _without_namespaces(text: bytes) -> ElementTree.Element:
    """Root element; ElementTree's own parser refuses prefixes that are not declared."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def check_limits(where: str, lower: float, upper: float) -> None:
    """Raise InputError if a revolute joint's limits are degrees."""
    least, most = LIMITS_IN_DEGREES
    if least < max(abs(lower), abs(upper)) <= most:
        raise InputError(f"{where}: limits {lower:g} and {upper:g} are in rad: degrees?")


def check_numbers(element: ElementTree.Element, where: str) -> None:
    """Check an element and those inside, and separate numbers by single blanks, as Pinocchio reads them.

    Raises InputError: an attribute does not have the numbers of `NUMBERS`.
    """
    for inner in element.iter():
        for name, count in NUMBERS.get(inner.tag, {}).items():
            if (text := inner.get(name)) is None:
                continue
            words = text.split()
            if len(words) != count or not all(_is_number(word) for word in words):
                which = inner.tag if inner is element else f"{element.tag} {inner.tag}"
                wanted = "a finite number" if count == 1 else f"{count} finite numbers"
                raise InputError(f"{where}: {which} {name}='{text}' is not {wanted}")
            inner.set(name, " ".join(words))


def _is_number(word: str) -> bool:
    return bool(NUMBER.fullmatch(word)) and math.isfinite(float(word))
