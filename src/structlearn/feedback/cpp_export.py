"""Controller of a skill as one C++ header: `controller.hpp` with the numbers of a skill file as constants.

The header computes what `runtime.Controller` does. It knows pose primitives, quaternion orientations and
phase-modulated networks; a skill with anything else is refused.
"""

import re
import textwrap
from dataclasses import fields
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from structlearn import __version__
from structlearn.core import quaternion
from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.used_files import digest
from structlearn.feedback.coupling import AXES
from structlearn.feedback.coupling_model import module_name
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.skill import FadingParameters, ReactiveSkill
from structlearn.feedback.skill_file import read_skill
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import SMALLEST_AMPLITUDE, VectorPrimitive

TEMPLATE = Path(__file__).with_name("controller.hpp")
COLUMNS = 100
ABSENT = ()  # initialises a structure with zeros

KNOWN = {
    *("primitives", "expected", "networks", "limits", "workspace", "sensors"),  # of a skill
    *("name", "position", "orientation"),  # of a primitive
}
"""Fields that the header has; a skill that uses others is refused."""


def write_header(skill_file: Path, name: str, folder: Path) -> Path:
    """Publish the header of a skill file in a folder, in place of an older one; return its path.

    `name`: of the skill, after which header and namespace are called. Raises InputError: as `read_skill`, the
    skill has parts that the header does not know, or the folder is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    skill, namespace = read_skill(skill_file), namespace_of(name)
    source = f"{name!a} (SHA-256 of its file: {digest(skill_file)[:16]})"
    try:
        text = header(skill, namespace, source)
    except InputError as error:
        raise InputError(f"{skill_file}: {error}") from error
    target = folder / f"{namespace}.hpp"
    with publish(target) as path:
        path.write_text(text, encoding="ascii")
    return target


def namespace_of(name: str) -> str:
    """C++ name of a skill, which is no keyword: `skill_pour` of `pour`, `skill` of `skill`."""
    return re.sub("[^A-Za-z0-9]+", "_", f"skill_{name}").strip("_").removesuffix("_skill")


def header(skill: ReactiveSkill, namespace: str, source: str) -> str:
    """Text of the header, in ASCII; `source`: which skill it is, for a comment.

    Raises InputError: the skill has parts that the header does not know, or no workspace.
    """
    networks = _known_networks(skill)
    assert skill.workspace is not None
    axes, limits, names = skill.axes, skill.limits, [one.name for one in skill.primitives]
    weights = [one.position.local.weights for one in skill.primitives]
    weights += [turning.weights for turning in map(_turning, skill.primitives) if turning is not None]
    weights += [traces.weights for traces in skill.expected.values()]
    arrays = {
        "skill": [_primitive(one) for one in skill.primitives],
        "expected": [_traces(skill.expected.get(name)) for name in names],
        "networks": [[_network(networks.get((name, axis))) for axis in axes] for name in names],
        "axis_indices": [AXES.index(axis) for axis in axes],
        "largest_coupling": [limits.largest_coupling[axis] for axis in axes],
        "workspace_low": skill.workspace.low,
        "workspace_high": skill.workspace.high,
    }
    used = networks.values()
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        namespace=namespace,
        source=source,
        version=__version__,
        sensors=ascii(dict(skill.sensors)),
        axis_names=", ".join(axes) or "none",
        primitive_count=len(names),
        channels=skill.channels,
        axis_count=len(axes),
        most_kernels=max([*map(len, weights), *(one.kernel_count for one in used)]),
        most_layers=max((len(one.hidden) for one in used), default=0),
        widest=max((width for one in used for width in one.sizes), default=0),
        most_values=max((len(one.compiled().values) for one in used), default=0),
        most_features=max((1 + one.sizes[-1] for one in used), default=0),
        **{name: repr(float(getattr(limits, name))) for name in FadingParameters.model_fields},
        **{name: _wrapped(_initialiser(array)) for name, array in arrays.items()},
    )


def _known_networks(skill: ReactiveSkill) -> dict[tuple[str, str], PhaseModulatedNetwork]:
    """Networks by primitive and axis.

    Raises InputError: the skill has parts that the header does not know, or no workspace.
    """
    but = "which the C++ header does not know"
    if skill.workspace is None:
        raise InputError("a skill without a workspace is not for a robot")
    parts: list[tuple[str, Any]] = [(f"'{one.name}'", one) for one in skill.primitives]
    for name, part in (("the skill", skill), *parts):
        for field in fields(part):
            if field.name not in KNOWN and np.any(getattr(part, field.name)):
                raise InputError(f"{name} has {field.name}, {but}")
    for one in skill.primitives:
        if one.rhythm is not None:
            raise InputError(f"'{one.name}' is rhythmic, {but}")
        for motion in (one.position, one.orientation):
            if not isinstance(motion, PositionPrimitive | QuaternionPrimitive | None):
                raise InputError(f"'{one.name}' has a {type(motion).__name__}, {but}")
    known = {}
    for name, by_axis in skill.networks.items():
        for axis, network in by_axis.items():
            if type(network) is not PhaseModulatedNetwork:
                raise InputError(f"the network of '{name}' for {axis} is a '{module_name(network)}', {but}")
            known[name, str(axis)] = network
    return known


def _primitive(one: PosePrimitive) -> tuple[Any, ...]:
    """`Primitive` of the header."""
    local, turning = one.position.local, _turning(one)
    reach = local.goal - local.start
    scaled = local.scaled & (np.abs(reach) >= SMALLEST_AMPLITUDE)  # as `vector.relative_scale`
    return (
        _quoted(one.name),
        local.duration,
        turning is not None,
        (one.position.start, quaternion.IDENTITY if turning is None else turning.start),
        (one.position.goal, quaternion.IDENTITY if turning is None else turning.goal),
        f"Frame::{one.position.frame}",
        np.where(scaled, reach, 0.0),
        _weights(local.weights),
        ABSENT if turning is None else _weights(turning.weights),
    )


def _turning(one: PosePrimitive) -> QuaternionPrimitive | None:
    assert isinstance(one.orientation, QuaternionPrimitive | None)  # as in every skill
    return one.orientation


def _traces(expected: VectorPrimitive | None) -> tuple[Any, ...]:
    """`Traces` of the header."""
    if expected is None:
        return ABSENT
    ends = (expected.start, expected.goal, expected.velocity, expected.acceleration)
    return (*ends, _weights(expected.weights))


def _network(network: PhaseModulatedNetwork | None) -> tuple[Any, ...]:
    """`Network` of the header."""
    if network is None:
        return ABSENT
    readout = np.column_stack([network.phase_biases, network.phase_weights])
    return (
        len(network.hidden),
        network.sizes,
        network.compiled().values,
        _weights(network.output_weights[:, None] * readout),
    )


def _weights(theta: np.ndarray) -> tuple[Any, ...]:
    """`Weights` of the header."""
    return len(theta), theta


def _initialiser(value: Any) -> str:
    """C++ initialiser: tuples are structures, lists and arrays are std::array, text is as it is.

    Shorter arrays are filled with zeros. Floats have the digits that read back as the same number.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return f"{{{', '.join(map(_initialiser, value))}}}"
    if isinstance(value, list | np.ndarray):
        return f"{{{{{', '.join(map(_initialiser, value))}}}}}" if len(value) else "{}"
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value.item() if isinstance(value, np.generic) else value)


def _quoted(text: str) -> str:
    """C++ string; what is not a letter or digit is escaped, also spaces, at which lines are broken."""
    escaped = re.sub(rb"[^A-Za-z0-9]", lambda one: b"\\%03o" % one[0][0], text.encode())
    return f'"{escaped.decode()}"'


def _wrapped(text: str) -> str:
    return textwrap.fill(text, COLUMNS, break_long_words=False, break_on_hyphens=False)
