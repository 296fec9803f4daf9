"""Edited skill files with a valid digest: a skill that is accepted must run with finite outputs."""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from feedback_skills import random_network, random_skill, random_strokes
from primitives_movements import reach

from structlearn.core.artefacts import read_description, read_tensors, write_tensors
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Networks, ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import KIND, read_skill, write_skill
from structlearn.primitives.outputs import Switching
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive

STATE = ("position", "velocity", "acceleration", "orientation", "angular_velocity", "angular_acceleration")
NUMBERS = (1e308, -1e308, 1e300, 1e15, 1e6, 1e-320, 0.0, -1.0, np.nan, np.inf)
TYPES = ("float16", "float32", "int64", "uint8", "bool")
WORDS: tuple[Any, ...] = (None, True, -1, 0, 99, 1e300, "", "x", "../x", [], {}, [[1]], "mm", 1e-300)


def write(path: Path) -> None:
    """A skill of three primitives, one of them with feedback on two axes."""
    rng = np.random.default_rng(0)
    _write(random_skill(rng, _networks(rng)), path)


def write_strokes(path: Path) -> None:
    """The same, with feedback on strokes."""
    rng = np.random.default_rng(0)
    _write(random_strokes(rng, _networks(rng)), path)


def _networks(rng: np.random.Generator) -> Networks:
    return {"tilt": {"z": random_network(rng), "rx": random_network(rng, size=10.0)}}


def _write(skill: ReactiveSkill, path: Path) -> None:
    paths = [primitive.position.unroll(0.01).position for primitive in skill.primitives]
    vars(skill)["workspace"] = demonstrated_workspace(paths, 0.05)
    write_skill(skill, path, {"bags": {}, "parameters": "", "version": "0"})


def write_joints(path: Path) -> None:
    """A skill that commands five joints, a continuous and a digital output."""
    rng, primitives = np.random.default_rng(0), []
    stops = rng.normal(0.0, 1.0, (3, 5))
    for name, start, goal in zip(("there", "back"), stops, stops[1:], strict=False):
        joints, opening = (
            fit_position([reach(rng, a, b, 0.6, 0.01, 0.02)], frame="none")
            for a, b in ((start, goal), (start[:1], goal[:1]))
        )
        edges = np.array([[0.0, 0.7], [0.0, 0.2]])
        primitives.append(
            PosePrimitive(name, joints, outputs=opening, switching=Switching(np.array([False]), edges))
        )
    paths, names = [one.position.unroll(0.01).position for one in primitives], tuple("abcde")
    box = demonstrated_workspace(paths, 0.0, names)
    skill = ReactiveSkill(primitives, workspace=box, joints=names, outputs=("o",), digital=("d",))
    write_skill(skill, path, {"bags": {}, "parameters": "", "version": "0"})


def sign(path: Path, tensors: dict[str, np.ndarray]) -> None:
    """Give a skill other numbers."""
    write_tensors(tensors, path, read_description(path))


def run(path: Path) -> np.ndarray:
    """Outputs of a skill, a row per tick; raises if one is not finite."""
    skill = read_skill(path)
    controller, first = Controller(skill, 100.0), skill.primitives[0]
    controller.start(first.position.start, None if first.orientation is None else first.orientation.start)
    samples = np.random.default_rng(1).normal(0.0, 30.0, (50, skill.channels))
    rows = []
    while not controller.finished and len(rows) < 2000:
        controller.tick(samples[len(rows) % 50])
        outputs = controller.coupling, controller.outputs
        rows.append(np.concatenate([*outputs, *(getattr(controller, name) for name in STATE)]))
    table = np.array(rows)
    if not np.isfinite(table).all():
        raise FloatingPointError("an output is not finite")
    return table


def forged(content: bytes, seed: int) -> tuple[str, bytes]:
    """Kind of edit, and the edited file with a valid digest."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "skill.safetensors")
        path.write_bytes(content)
        tensors, description = read_tensors(path), json.loads(read_description(path))
        name = sorted(tensors)[rng.integers(len(tensors))]
        kind = ("number", "scale", "shape", "type", "absent", "word", "word", "key")[rng.integers(8)]
        tensor = np.array(tensors[name])
        with np.errstate(all="ignore"):
            if kind == "number":
                tensor = tensor.astype(float)
                tensor.flat[rng.integers(max(tensor.size, 1))] = rng.choice(NUMBERS)
            elif kind == "scale":
                tensor = tensor * rng.choice(NUMBERS)
            elif kind == "shape":
                tensor = [tensor[None], tensor.ravel(), tensor.T, tensor.ravel()[:0], np.repeat(tensor, 2)][
                    rng.integers(5)
                ]
            elif kind == "type":
                tensor = tensor.astype(rng.choice(TYPES))
        if kind == "absent":
            del tensors[name]
        else:
            tensors[name] = tensor
        if kind in ("word", "key"):
            places = list(_places(description[KIND]))
            holder, key = places[rng.integers(len(places))]
            if kind == "key":
                del holder[key]
            else:
                holder[key] = WORDS[rng.integers(len(WORDS))]
        write_tensors(tensors, path, json.dumps(description))
        return kind, path.read_bytes()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Everything in a tree, by what holds it and its key there."""
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])
