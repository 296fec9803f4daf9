"""Task entries of a project, merged over the defaults of their kind.

    defaults:            in the package, every constant once
      movement:
        clock: {rate_hz: 200.0, max_gap_s: 0.2}
    movement:            in structlearn.yaml, what differs
      pick:
        source: ~/demonstrations
        topics: {pose: /end_effector/pose}

A part (`PARTS`) that an entry does not name is null, whatever its defaults.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.params import checked, merged, read_values, value_at
from structlearn.core.used_files import digest, remember_value
from structlearn.readers.source import SourceParameters
from structlearn.tasks.kinds import kind_defaults, module_of
from structlearn.tasks.project import ENTRIES, PIPELINE
from structlearn.tasks.task_files import NAME_RULE, is_name, is_public, local_path

# Keys that a task only has if its entry names them
PARTS = ("segment", "rests", "stiffness", "feedback", "corrections", "robot")


class Entry(NamedTuple):
    """An entry as written in a file."""

    kind: str
    values: Any


def read_entries(file: Path = ENTRIES) -> dict[str, Entry]:
    """All entries by name.

    Raises InputError: the file is not readable or has an unknown kind, or a name is invalid or repeated.
    """
    if not file.exists():
        raise InputError(f"{file}: no such file here; `structlearn new` makes a project")
    entries: dict[str, Entry] = {}
    values = read_values(file, whole=False) or {}
    if not isinstance(values, dict):
        raise InputError(f"{file}: is no mapping of kinds of data to tasks")
    for kind, tasks in values.items():
        model(file, kind)
        if not isinstance(tasks, dict):
            raise InputError(f"{file}: {kind}: is no mapping of names to tasks; without any write {{}}")
        for name, entry in tasks.items():
            if not is_name(name):
                raise InputError(f"{file}: {kind}: {name!r}: {NAME_RULE}")
            if name in entries:
                raise InputError(f"{file}: {kind}.{name}: the name is taken: {entries[name].kind}")
            entries[name] = Entry(kind, entry)
    return entries


def add_entry(kind: str, name: str, proposed: Callable[[], list[str]], file: Path = ENTRIES) -> None:
    """Add an entry to a file, with all else as it was written, and publish it.

    `proposed`: gives the entry's YAML lines, indented by two blanks; is only called for a name that is free.

    Raises InputError: as `read_entries`; or the name is invalid or taken, or the file changed meanwhile.
    """
    if not is_name(name):
        raise InputError(f"{name!r}: {NAME_RULE}")
    entries = read_entries(file)
    if name in entries:
        raise InputError(f"{file}: {entries[name].kind}.{name}: there is such a task already")
    before = file.read_text(encoding="utf-8")
    lines = proposed()
    text, added = _with_entry(before, kind, lines), yaml.safe_load("\n".join([f"{kind}:", *lines]))
    try:
        unharmed = yaml.safe_load(text) == merged(yaml.safe_load(before) or {}, added)
    except yaml.YAMLError:
        unharmed = False
    if not unharmed:
        raise InputError(f"{file}: {kind}: is not written line by line, so nothing can be added below it")
    if file.read_text(encoding="utf-8") != before:
        raise InputError(f"{file}: changed meanwhile; run it again")
    with publish(file) as target:
        target.write_text(text, encoding="utf-8")


def _with_entry(text: str, kind: str, entry: Sequence[str]) -> str:
    """Text of an entries file with a further entry at the end of its kind, if it is written in lines."""
    lines = text.rstrip("\n").split("\n")
    heading = re.compile(rf"{re.escape(kind)}:\s*({{\s*}})?\s*(#.*)?$")
    start = next((place for place, line in enumerate(lines) if heading.match(line)), None)
    if start is None:
        return "\n".join([*lines, "", f"{kind}:", *entry, ""])
    lines[start] = re.sub(r"{\s*}", "", lines[start], count=1)
    below = takewhile(lambda line: not re.match(r"[^\s#]", line), lines[start + 1 :])
    inside = [place for place, line in enumerate(below, start + 1) if re.match(r"\s+[^\s#]", line)]
    first, end = lines[inside[0]] if inside else entry[0], inside[-1] + 1 if inside else start + 1
    indent = first[: len(first) - len(first.lstrip())]
    return "\n".join([*lines[:end], *(f"{indent}{line[2:]}" for line in entry), *lines[end:], ""])


def model(file: Path, kind: Any) -> type[SourceParameters]:
    """Model of the entries of a kind. Raises InputError: there is no such kind."""
    try:
        return module_of(str(kind), "parameters").Entry
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def read_task(name: str, file: Path = ENTRIES) -> Any:
    """Parameters of one task, as the model of its kind.

    Raises InputError: as `read_entries`; or there is no such task, or a value is missing, unknown or out of
    range; the message names file and key.
    """
    entries = read_entries(file)
    if name not in entries:
        raise InputError(f"{file}: {name}: there is no such task among {', '.join(entries) or 'none'}")
    kind, entry = entries[name]
    remember_value(
        file, f"{kind}.{name}", entry, lambda: read_entries(file).get(name, Entry("", None)).values
    )
    if not isinstance(entry, dict):
        raise InputError(f"{file}: {kind}.{name}: is no mapping of parameters")
    return as_task(kind, entry, file, f"{kind}.{name}")


def as_task(kind: str, entry: Mapping[str, Any], file: Path, key: str) -> Any:
    """Parameters of an entry over the defaults of its kind; `file` and `key`: its place, for messages."""
    values = merged(kind_defaults(kind), entry)
    values |= {part: None for part in PARTS if part in values and entry.get(part) is None}
    return checked(values, model(file, kind), file, key)


def read_checked(path: Path) -> SourceParameters:
    """Read parameters published by `write_task`."""
    entry = model(path, value_at(path, "kind"))
    return checked(value_at(path, "entry"), entry, path, "entry")


def source_digests(task: SourceParameters) -> dict[str, dict[str, str]]:
    """`file_digests` of all sources of a task, by their role; of a robot that is checked, with its meshes."""
    return {
        role: {name: digest for path in paths for name, digest in file_digests(path, role == "robot").items()}
        for role, paths in task.sources().items()
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


def file_digests(source: str, meshes: bool = False) -> dict[str, str]:
    """SHA-256 of a file, or of all but hidden files below a folder, by path as written.

    `meshes`: with those of the files that a URDF names. Empty for a public set that is not here. Raises
    InputError: there is no such file or folder.
    """
    path = local_path(source)
    if is_public(source) and not path.exists():
        return {}
    if path.suffix == ".urdf" or meshes:
        from structlearn.readers.urdf_file import urdf_path

        path = urdf_path(str(path))
    if not path.exists():
        raise InputError(f"{source}: no such file or folder")
    files = {source: path} if path.is_file() else {}
    if meshes:
        from structlearn.rigid_body.urdf import named_files

        with suppress(InputError):  # the check will say why
            files |= {f"{source}: {name}": file for name, file in named_files(path).items()}
    for file in sorted(path.rglob("*")) if path.is_dir() else ():
        below = file.relative_to(path)
        if file.is_file() and not any(part.startswith(".") for part in below.parts):
            files[f"{source}/{below.as_posix()}"] = file
    return {name: digest(file) for name, file in files.items()}


def targets(name: str = "") -> list[str]:
    """Stages of one task or of all, as DVC targets in their order; entries are checked first.

    Raises InputError: an entry is not valid.
    """
    kinds = {task: read_task(task).kind for task in ([name] if name else read_entries())}
    stages = read_values(PIPELINE)["stages"].items()
    return [
        f"{stage}@{task}"
        for task, kind in kinds.items()
        for stage, about in stages
        if (over := about.get("foreach")) == f"${{{kind}}}" or (isinstance(over, list) and task in over)
    ]
