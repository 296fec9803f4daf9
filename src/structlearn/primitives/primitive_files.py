"""Primitives as safetensors: all arrays by name, with non-numeric fields in the description.

Names are `<primitive>.position.<array>`, `<primitive>.orientation.<array>`, `<primitive>.outputs.<array>` and
`<primitive>.switching.<array>`. Lengths are in m, angles in rad, times in s, quaternions scalar-first,
forcing weights in the unit of the coordinate; joints and outputs are in the unit in which they were recorded.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NotRequired, TypedDict, get_args

import numpy as np

from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.core.frames import FrameKind
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.outputs import Switching
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.rhythmic import PARTS, Rhythm
from structlearn.primitives.sequence import OrientationPrimitive, PosePrimitive
from structlearn.primitives.twist_swing import TwistSwingPrimitive
from structlearn.primitives.vector import VectorPrimitive

Tensors = dict[str, np.ndarray]

FEWEST_CYCLES, MOST_CYCLES = 0.01, 1e4  # of a rhythmic primitive; others suggest a damaged file


class PrimitiveKind(TypedDict):
    """Non-numeric fields of a pose primitive."""

    name: str
    frame: FrameKind
    orientation: Literal["quaternion", "twist_swing"] | None
    beside: NotRequired[list[str]]  # which of `BESIDE` it has


BESIDE = ("outputs", "switching")


def write_primitives(primitives: Sequence[PosePrimitive], path: str | Path) -> None:
    """Publish a sequence of pose primitives."""
    tensors, kinds = primitive_tensors(primitives)
    write_tensors(tensors, path, json.dumps({"pose_primitives": kinds}))


def read_primitives(path: str | Path) -> list[PosePrimitive]:
    """Read a sequence of pose primitives.

    Raises InputError: the file is missing or is not such a file.
    """
    tensors = read_tensors(path)
    with holding(path, "pose primitives"):
        return pose_primitives(json.loads(read_description(path))["pose_primitives"], tensors)


def write_vector_primitive(primitive: VectorPrimitive, path: str | Path, description: str) -> None:
    """Publish one vector primitive, e.g. the expected traces of a set of sensors."""
    write_tensors(vector_tensors(primitive), path, description)


def read_vector_primitive(path: str | Path) -> VectorPrimitive:
    """Read one vector primitive; InputError as `read_primitives`."""
    tensors = read_tensors(path)
    with holding(path, "vector primitive"):
        return vector_primitive(tensors)


def primitive_tensors(primitives: Sequence[PosePrimitive]) -> tuple[Tensors, list[PrimitiveKind]]:
    """Arrays of a sequence of pose primitives, and the non-numeric fields of each."""
    tensors: Tensors = {}
    kinds: list[PrimitiveKind] = []
    for primitive in primitives:
        name, position, orientation = primitive.name, primitive.position, primitive.orientation
        tensors |= prefixed(f"{name}.position", vector_tensors(position))
        form: Literal["quaternion", "twist_swing"] | None = None
        if orientation is not None:
            form = "quaternion" if isinstance(orientation, QuaternionPrimitive) else "twist_swing"
            tensors |= prefixed(f"{name}.orientation", vector_tensors(orientation))
        kinds.append({"name": name, "frame": position.frame, "orientation": form})
        if primitive.outputs is not None:
            tensors |= prefixed(f"{name}.outputs", vector_tensors(primitive.outputs))
        if primitive.switching is not None:
            first, edges = primitive.switching.first.astype(float), primitive.switching.edges
            tensors |= prefixed(f"{name}.switching", {"first": first, "edges": edges})
        if beside := [part for part in BESIDE if getattr(primitive, part) is not None]:
            kinds[-1]["beside"] = beside
    return tensors, kinds


def pose_primitives(kinds: Sequence[PrimitiveKind], tensors: Tensors) -> list[PosePrimitive]:
    """The inverse of `primitive_tensors`. Raises KeyError: an array is missing."""
    primitives = []
    for kind in kinds:
        name, frame = kind["name"], kind["frame"]
        if frame not in get_args(FrameKind):
            raise InputError(f"'{name}': there is no frame '{frame}'")
        position = _position_primitive(name, frame, tensors_below(f"{name}.position", tensors))
        if frame != "none" and len(position.goal) != 3:
            raise InputError(f"'{name}': a position has three coordinates")
        orientation = _orientation_primitive(
            kind["orientation"], tensors_below(f"{name}.orientation", tensors)
        )
        beside: dict[str, Any] = {}
        for part in kind.get("beside", ()):
            own = tensors_below(f"{name}.{part}", tensors)
            if part not in BESIDE:
                raise InputError(f"'{name}': there is no part '{part}'")
            is_digital = part == "switching"
            beside[part] = _switching(name, own) if is_digital else _position_primitive(name, "none", own)
        primitives.append(PosePrimitive(name, position, orientation, **beside))
    return primitives


def _position_primitive(name: str, frame: FrameKind, tensors: Tensors) -> PositionPrimitive:
    local, start, goal = vector_primitive(tensors_below("local", tensors)), tensors["start"], tensors["goal"]
    if not local.goal.shape == start.shape == goal.shape:
        raise InputError(f"'{name}': start and goal have shapes {start.shape} and {goal.shape}")
    return PositionPrimitive(local, frame, start, goal)


def _switching(name: str, tensors: Tensors) -> Switching:
    """Raises InputError: shapes are wrong, a state is neither 0 nor 1, or an edge is of no output."""
    first, edges = tensors["first"], tensors["edges"]
    known = first.ndim == 1 and edges.ndim == 2 and edges.shape[1:] == (2,)
    if not (known and np.isin(first, (0, 1)).all() and np.isin(edges[:, 0], range(len(first))).all()):
        raise InputError(f"'{name}': digital outputs begin with {first} and change at {edges.tolist()[:4]}")
    return Switching(first.astype(bool), edges)


def vector_tensors(primitive: VectorPrimitive | PositionPrimitive | OrientationPrimitive) -> Tensors:
    """Arrays of a primitive by name; those of a nested vector primitive are called `<field>.<name>`."""
    tensors: Tensors = {}
    for name, value in vars(primitive).items():
        if isinstance(value, VectorPrimitive):
            tensors |= prefixed(name, vector_tensors(value))
        elif not isinstance(value, str | None):
            tensors[name] = np.asarray(value)
    return tensors


def vector_primitive(tensors: Tensors) -> VectorPrimitive:
    """Vector primitive from its arrays. Raises KeyError: one is missing; InputError: a shape is wrong."""
    size = len(tensors["goal"])
    shapes = dict.fromkeys(("start", "goal", "velocity", "acceleration", "scaled"), (size,))
    return VectorPrimitive(**_checked(size, shapes, tensors))


def prefixed(prefix: str, tensors: Tensors) -> Tensors:
    """Arrays as `<prefix>.<name>`."""
    return {f"{prefix}.{name}": tensor for name, tensor in tensors.items()}


def tensors_below(prefix: str, tensors: Tensors) -> Tensors:
    """The arrays called `<prefix>.<name>`, keyed by name."""
    start = f"{prefix}."
    return {name.removeprefix(start): array for name, array in tensors.items() if name.startswith(start)}


def _orientation_primitive(form: str | None, tensors: Tensors) -> OrientationPrimitive | None:
    if form is None:
        return None
    if form == "twist_swing":
        chart = vector_primitive(tensors_below("chart", tensors))
        return TwistSwingPrimitive(chart, tensors["axes"], tensors["start"], tensors["goal"])
    if form != "quaternion":
        raise InputError(f"there is no orientation of the form '{form}'")
    for name in ("start", "goal"):
        if not abs(np.linalg.norm(tensors[name]) - 1.0) < 1e-6:
            raise InputError(f"the {name} of an orientation is no unit quaternion: {tensors[name]}")
    shapes = {"start": (4,), "goal": (4,), "velocity": (3,), "acceleration": (3,)}
    return QuaternionPrimitive(**_checked(3, shapes, tensors))


def _checked(size: int, shapes: Mapping[str, tuple[int, ...]], tensors: Tensors) -> dict[str, Any]:
    """Check shapes: as given, weights (N, size) with N >= 2, and a scalar duration."""
    for name, shape in shapes.items():
        if tensors[name].shape != shape:
            raise InputError(f"{name} has shape {tensors[name].shape}, not {shape}")
    weights, duration = tensors["weights"], tensors["duration"]
    if weights.ndim != 2 or weights.shape[-1] != size or len(weights) < 2:
        raise InputError(f"weights have shape {weights.shape}, not (N, {size}) with N of 2 or more")
    if duration.shape != () or not duration > 0.0:
        raise InputError(f"the duration is {duration}, not a positive number of s")
    fields: dict[str, Any] = {name: tensors[name] for name in ("weights", *shapes)} | {
        "duration": float(duration)
    }
    if "rhythm" in tensors:
        rhythm = tensors["rhythm"]
        cycles = f"{FEWEST_CYCLES:g} to {MOST_CYCLES:g}"
        if rhythm.shape != (2,) or not FEWEST_CYCLES <= rhythm[1] <= MOST_CYCLES or len(weights) % PARTS:
            raise InputError(
                f"its rhythm is {rhythm} with weights {weights.shape}, not a phase and {cycles} cycles with "
                f"weights (3 N, {size})"
            )
        fields["rhythm"] = Rhythm(*rhythm.tolist())
    return fields
