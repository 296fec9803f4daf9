"""Parameters for tests: those that stand in `params.yaml`, with what a test changes."""

import runpy
import sys
from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import pytest
import yaml

from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import FingerParameters, TouchFingerParameters
from structlearn.core.params import Parameters, merged
from structlearn.readers.source import TopicMap
from structlearn.tasks.kinds import KINDS
from structlearn.tasks.project import ENTRIES, STAGES
from structlearn.tasks.task_entry import PARTS, read_task

ROOT = Path(__file__).parents[1]
PARAMETER_FILE = ROOT / "params.yaml"
TASK_FILE = ROOT / "src/structlearn/tasks/stages/params.yaml"
SETS = ROOT / "src/dissertation/recorded"
EXAMPLE_TASK = read_task("pick", ROOT / "examples/pick.yaml")
NO_TOPICS = {
    "twist": None,
    "joint_states": [],
    "joints": None,
    "wrench": None,
    "tactile": [],
    "tool_to_board": None,
}

ParametersType = TypeVar("ParametersType", bound=Parameters)


@cache
def _tree() -> dict[str, Any]:
    return read_yaml(PARAMETER_FILE) | read_yaml(TASK_FILE)


def read_yaml(path: Path) -> Any:
    """Content of a YAML file, by the parser that takes a tenth of the time."""
    return yaml.load(path.read_text(), yaml.CSafeLoader)


def parameter_tree(changes: Mapping[str, Any]) -> dict[str, Any]:
    """All of the parameter files with some changes, e.g. to write it for stages in a folder of their own."""
    return merged(deepcopy(_tree()), changes)


def own_tasks(
    folder: Path, changes: Mapping[str, Any] | None = None, kind: str = "movement", **tasks: Any
) -> None:
    """Write the entries of a project: tasks of one kind, with changes of what each has."""
    for name, task in tasks.items():
        if isinstance(task, Mapping):
            its = {key: one for key, one in (changes or {}).items() if key not in PARTS or key in task}
            tasks[name] = merged(its, task)
    (folder / ENTRIES).write_text(
        yaml.safe_dump({one: {} for one in KINDS} | {kind: tasks}), encoding="utf-8"
    )


def run_stages(task: str, *stages: str | Path) -> None:
    """Some stages of a task in the working directory: of the package by name, or other scripts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["stage", task])
        for stage in stages:
            script = STAGES / f"{stage}.py" if isinstance(stage, str) else stage
            runpy.run_path(str(script), run_name="__main__")


def committed(model: type[ParametersType], key: str, **changes: Any) -> ParametersType:
    """The parameters at a dotted key of a pipeline's file, with changes; nested ones by a mapping or a model.

    A base class takes what it knows of the key.
    """
    values: Any = _tree()
    for part in key.split("."):
        values = values[part]
    known = {name: value for name, value in values.items() if name in model.model_fields}
    return model.model_validate(merged(known, changes))


def committed_entry(name: str, **changes: Any) -> Any:
    """The parameters of a public set in `public.yaml`, with changes."""
    entry = read_task(name, SETS / "public.yaml")
    return type(entry).model_validate(merged(entry.model_dump(), changes))


def committed_finger(**changes: Any) -> FingerParameters:
    """The finger that touches, with its electrodes."""
    own = committed(TouchFingerParameters, "touch_finger")
    electrodes = committed(PinchParameters, "testbed.touch")
    return own.with_electrodes_of(electrodes).model_copy(update=changes)


def topic_map(**topics: Any) -> TopicMap:
    """Topics of a robot's bag that has no others."""
    return TopicMap(**NO_TOPICS | topics)
