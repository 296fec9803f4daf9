"""Task entries in the files of `project.entry_files`, merged over the defaults of their kind.

    defaults:            in params.yaml, every constant once
      movement:
        clock: {rate_hz: 200.0, max_gap_s: 0.2}
    movement:            in own.yaml, what differs
      pick:
        source: ~/demonstrations
        topics: {pose: /end_effector/pose}

A part (`PARTS`) that an entry does not name is null, whatever its defaults.
"""

import sys
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from dissertation.recorded.coupling_representations import RepresentationParameters
from structlearn.avoidance.scene_reaches import SceneLearningParameters
from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.params import checked, merged, read_values, value_at
from structlearn.core.reading import digest
from structlearn.core.stage import run
from structlearn.readers.source import ClockParameters, SceneTopicMap, SourceParameters
from structlearn.tasks import project
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.movement.movement_parameters import MovementEntry
from structlearn.tasks.task_files import NAME_RULE, is_name, is_public, local_path
from structlearn.tasks.touch.touch_parameters import TouchParameters

# Keys that a task only has if its entry names them
PARTS = ("segment", "rests", "feedback", "corrections", "robot", "representations")


class ObstacleEntry(SourceParameters, SceneLearningParameters):
    """Reaches past obstacles."""

    kind = "obstacles"

    topics: SceneTopicMap | None
    clock: ClockParameters | None
    representations: RepresentationParameters | None


# Kinds of data, which group entries
KINDS: dict[str, type[SourceParameters]] = {
    entry.kind: entry for entry in (MovementEntry, MotionParameters, TouchParameters, ObstacleEntry)
}


class Entry(NamedTuple):
    """An entry as written in a file."""

    file: Path
    kind: str
    values: Any


def read_entries(clone: Path | None = None) -> dict[str, Entry]:
    """All entries by name, of this project or of a clone's folder.

    Raises InputError: a file is not readable or has an unknown kind, or a name is invalid or repeated.
    """
    found: dict[str, Entry] = {}
    for file in project.entry_files(clone):
        values = read_values(file) or {}
        if not isinstance(values, dict):
            raise InputError(f"{file}: is no mapping of kinds of data to tasks")
        for kind, tasks in values.items():
            if kind not in KINDS:
                raise InputError(f"{file}: {kind}: there is no such kind among {', '.join(KINDS)}")
            if not isinstance(tasks, dict):
                raise InputError(f"{file}: {kind}: is no mapping of names to tasks; without any write {{}}")
            for name, entry in tasks.items():
                if not is_name(name):
                    raise InputError(f"{file}: {kind}: {name!r}: {NAME_RULE}")
                if name in found:
                    taken = f"{found[name].file}, {found[name].kind}"
                    raise InputError(f"{file}: {kind}.{name}: the name is taken: {taken}")
                found[name] = Entry(file, kind, entry)
    return found


def read_task(name: str, clone: Path | None = None) -> Any:
    """Parameters of one task, as the model of its kind.

    Raises InputError: as `read_entries`; or there is no such task, or a value is missing, unknown or out of
    range; the message names file and key.
    """
    entries = read_entries(clone)
    if name not in entries:
        own = project.entry_files(clone)[-1]
        there = [one for one, entry in entries.items() if entry.file == own]
        raise InputError(f"{own}: {name}: there is no such task among {', '.join(there) or 'none'}")
    file, kind, entry = entries[name]
    if not isinstance(entry, dict):
        raise InputError(f"{file}: {kind}.{name}: is no mapping of parameters")
    values = merged(value_at(project.defaults_file(clone), f"defaults.{kind}") or {}, entry)
    values |= {part: None for part in PARTS if part in values and entry.get(part) is None}
    return checked(values, KINDS[kind], file, f"{kind}.{name}")


def read_checked(path: Path) -> SourceParameters:
    """Read parameters published by `write_task`."""
    if (kind := value_at(path, "kind")) not in KINDS:
        raise InputError(f"{path}: kind: there is no such kind among {', '.join(KINDS)}")
    return checked(value_at(path, "entry"), KINDS[kind], path, "entry")


def source_digests(task: SourceParameters) -> dict[str, dict[str, str]]:
    """`file_digests` of all sources of a task, by their role."""
    return {
        name: {file: digest for path in paths for file, digest in file_digests(path).items()}
        for name, paths in task.sources().items()
    }


def write_task(task: SourceParameters, files: dict[str, dict[str, str]], path: Path) -> None:
    """Publish a task's parameters with the digests of its sources from before they were read.

    Raises InputError: a source has changed since.
    """
    for kind, now in source_digests(task).items():
        if changed := sorted({name for name, _ in now.items() ^ files[kind].items()}):
            raise InputError(f"{', '.join(changed)}: changed while it was read; run it again")
    content = {"kind": task.kind, "entry": task.model_dump(mode="json"), "files": files}
    with publish(path) as target:
        target.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def file_digests(source: str) -> dict[str, str]:
    """SHA-256 of a file, or of all but hidden files below a folder, by path as written.

    Empty for a public set that is not here. Raises InputError: there is no such file or folder.
    """
    path = local_path(source)
    if is_public(source) and not path.exists():
        return {}
    if path.suffix == ".urdf":
        from structlearn.rigid_body.urdf import urdf_path

        path = urdf_path(str(path))
    if not path.exists():
        raise InputError(f"{source}: no such file or folder")
    found = {source: path} if path.is_file() else {}
    for file in sorted(path.rglob("*")) if path.is_dir() else ():
        below = file.relative_to(path)
        if file.is_file() and not any(part.startswith(".") for part in below.parts):
            found[f"{source}/{below.as_posix()}"] = file
    return {name: digest(file) for name, file in found.items()}


def targets(which: str, name: str = "") -> list[str]:
    """Stages of one task or of all of a file, as DVC targets in their order; entries are checked first.

    Raises InputError: an entry is not valid, or there is no public set.
    """
    entries = {key: one for key, one in read_entries().items() if one.file.name == which}
    sources = [local_path(str(one.values.get("source"))) for one in entries.values()]
    if which == project.OF_PUBLIC and not any(source.exists() for source in sources):
        folder = local_path("$DATA")
        raise InputError(f"{folder}: holds no public set; name their folder: make recorded DATA=FOLDER")
    kinds = {one: read_task(one).kind for one in ([name] if name else entries)}
    stages = read_values(project.pipeline())["stages"].items()
    return [
        f"{project.pipeline()}:{stage}@{one}"
        for one, kind in kinds.items()
        for stage, its in stages
        if its.get("foreach") == f"${{{kind}}}"
    ]


if __name__ == "__main__":  # run before DVC, whose errors would not say what is wrong with an entry
    run(lambda: print("\n".join(targets(*sys.argv[1:]))))
