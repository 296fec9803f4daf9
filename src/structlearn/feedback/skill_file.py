"""A skill as one safetensors file: everything a robot needs, with bounds, units and provenance.

Tensors are `primitives.<primitive>...` as in `primitives.primitive_files`, `expected.<primitive>.<array>`,
`networks.<primitive>.<axis>.<array>`, `workspace` (2, 3), its low and high corner, (2, J) of joints, and, if
the skill suggests one, `stiffness.<primitive>` (M, 3 or 6). Joints and outputs are in the units in which they
were recorded. The rest is in the description, with a digest of everything (`core.artefacts`).
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from structlearn import __version__
from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.core.params import checked
from structlearn.core.used_files import digest
from structlearn.feedback.coupling import AXES, unit
from structlearn.feedback.coupling_model import module_name, named_model
from structlearn.feedback.skill import FadingParameters, Limits, ReactiveSkill, Workspace
from structlearn.primitives.primitive_files import (
    pose_primitives,
    prefixed,
    primitive_tensors,
    tensors_below,
    vector_primitive,
    vector_tensors,
)
from structlearn.primitives.sequence import default_goals, default_start
from structlearn.primitives.vector import OFFSET_SAMPLES

KIND = "reactive_skill"  # only key of the description
UNITS = {
    "length": "m",
    "angle": "rad",
    "time": "s",
    "orientation": "unit quaternion w, x, y, z, own to base frame",
    "coupling": {axis: unit(axis) for axis in AXES},
    "tactile": "counts",
    "wrench": "force in N, then torque in N m",
}

VERSION, RHYTHMIC, BESIDE = 1, 2, 3
"""Of the file format: of poses, with rhythmic primitives, with joints or outputs."""
COMMANDED = ("joints", "outputs", "digital")  # keys with names, if there are any
LARGEST = 1e9
"""Largest absolute value that is accepted; below it no tick overflows."""
SHORTEST_S, LONGEST_S = 1e-3, 1000.0  # of a primitive: at least a tick; more suggests a unit error

STIFFNESS = (  # `primitives.stiffness`
    "N/m along x, y, z of the base, then N m/rad about them, at equal parts of the duration: "
    "clip(force / spread of the demonstrations about the primitive, softest, stiffest)"
)

READINGS = (
    "A sample has the channels of all sensors, in their order, as the drivers give them. The mean of the "
    f"first {OFFSET_SAMPLES} good samples of a run, at rest and in the air, is its offset and is taken off: "
    "raw and zeroed readings are the same, as long as nothing is zeroed anew within a run."
)


class SkillParameters(FadingParameters):
    """Contents of a skill file beyond what was learned."""

    workspace_margin_m: float = Field(gt=0)


def write_skill(skill: ReactiveSkill, path: str | Path, provenance: Mapping[str, Any]) -> None:
    """Publish a skill with its `provenance`.

    Raises InputError: the skill has no workspace, or the file cannot be written.
    """
    if skill.workspace is None:
        raise InputError(f"{path}: a skill without a workspace is not for a robot")
    tensors, kinds = primitive_tensors(skill.primitives)
    tensors = prefixed("primitives", tensors)
    tensors["workspace"] = np.array([skill.workspace.low, skill.workspace.high])
    for name, traces in skill.expected.items():
        tensors |= prefixed(f"expected.{name}", vector_tensors(traces))
    tensors |= prefixed("stiffness", dict(skill.stiffness))
    models = {}
    for name, by_axis in skill.networks.items():
        models[name] = {axis: module_name(network) for axis, network in by_axis.items()}
        for axis, network in by_axis.items():
            tensors |= prefixed(f"networks.{name}.{axis}", network.arrays())
    named = {key: list(names) for key in COMMANDED if (names := getattr(skill, key))}
    rhythmic = any(one.rhythm is not None for one in skill.primitives)
    description = {
        "version": BESIDE if named else RHYTHMIC if rhythmic else VERSION,
        "primitives": kinds,
        "expected": list(skill.expected),
        "networks": models,
        "sensors": skill.sensors,
        **named,
        "limits": skill.limits.model_dump(),
        "units": UNITS,
        "readings": READINGS,
        "provenance": dict(provenance),
    }
    if skill.stiffness:
        description["stiffness"] = STIFFNESS
    write_tensors(tensors, path, json.dumps({KIND: description}))


def read_skill(path: str | Path) -> ReactiveSkill:
    """Read a skill, checked such that every tick yields finite values.

    Raises InputError: the file is missing, damaged or not a skill, has another version or other units, lacks
    a limit, has a number out of range or a goal outside its workspace, or its parts do not fit together.
    """
    tensors, described = read_tensors(path), _described(path)
    with holding(path, "skill of this version"):
        _check(tensors, described)
        expected = {
            name: vector_primitive(tensors_below(f"expected.{name}", tensors))
            for name in described["expected"]
        }
        networks = {
            name: {
                axis: named_model(model).from_arrays(tensors_below(f"networks.{name}.{axis}", tensors))
                for axis, model in by_axis.items()
            }
            for name, by_axis in described["networks"].items()
        }
        named = {key: _names(described, key) for key in COMMANDED}
        low, high = tensors["workspace"]
        workspace = Workspace(low, high, named["joints"])
        skill = ReactiveSkill(
            pose_primitives(described["primitives"], tensors_below("primitives", tensors)),
            expected,
            networks,
            checked(described["limits"], Limits, KIND, "limits"),
            workspace,
            tuple((name, count) for name, count in described["sensors"]),
            stiffness=tensors_below("stiffness", tensors),
            **named,
        )
        for pose in (default_start(skill.primitives), *default_goals(skill.primitives)):
            workspace.require(pose.position, "a demonstrated start or goal")
        return skill


def read_provenance(path: str | Path) -> dict[str, Any]:
    """Provenance of a skill. Raises InputError: as `read_skill`."""
    read_tensors(path)  # verifies the digest, which includes the description
    return _described(path)["provenance"]


def skill_provenance(bags: Sequence[Path], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Recordings, parameters and version that a skill was learned with.

    `bags`: files or folders of recordings, with all files below. `parameters`: all that were used, by stage.
    Returns `bags`, SHA-256 by file name, starting with the given folder; `parameters`, SHA-256 of their
    sorted JSON; `version` of this package.
    """
    digests = {}
    for source in bags:
        files = sorted(path for path in source.rglob("*") if path.is_file()) if source.is_dir() else [source]
        for file in files:
            name = file.relative_to(source.parent).as_posix()
            digests[name] = digest(file)
    text = json.dumps(parameters, sort_keys=True)
    return {"bags": digests, "parameters": hashlib.sha256(text.encode()).hexdigest(), "version": __version__}


def _described(path: str | Path) -> dict[str, Any]:
    description = read_description(path)
    with holding(path, "skill"):
        return json.loads(description)[KIND]


def _names(described: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Names of joints or outputs. Raises InputError: they are none."""
    names = described.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise InputError(f"its {key} are {names!r}, not names")
    if len(set(names)) < len(names):
        raise InputError(f"two of its {key} have one name: {', '.join(names)}")
    return tuple(names)


def _check(tensors: Mapping[str, np.ndarray], described: Mapping[str, Any]) -> None:
    """Refuse other versions and units, missing limits, and numbers or durations out of range."""
    if (version := described.get("version")) not in (VERSION, RHYTHMIC, BESIDE):
        raise InputError(
            f"a skill file of version {version}; version {VERSION} is read, and {RHYTHMIC} with strokes, "
            f"{BESIDE} with joints or outputs"
        )
    if described["units"] != UNITS:
        raise InputError(f"its units are not those of a skill: {json.dumps(UNITS)}")
    if missing := sorted(set(Limits.model_fields) - set(described["limits"])):
        raise InputError(f"its limits lack {', '.join(missing)}")
    for name, array in tensors.items():
        if array.dtype != (bool if name.endswith(".scaled") else float):
            raise InputError(f"{name} has numbers of type {array.dtype}")
        if np.abs(array).max(initial=0.0) > LARGEST:
            raise InputError(f"{name} holds {np.abs(array).max():g}, more than {LARGEST:g}")
        if name.endswith(".duration") and not SHORTEST_S <= array <= LONGEST_S:
            raise InputError(f"{name} is {array:g} s, not within {SHORTEST_S:g} and {LONGEST_S:g} s")
