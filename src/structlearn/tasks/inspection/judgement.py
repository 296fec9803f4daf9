"""What the import says of a proposed entry: its own functions read every recording; nothing is written."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from structlearn.core.errors import InputError
from structlearn.readers.source_files import recording_files
from structlearn.tasks.kinds import module_of
from structlearn.tasks.task_entry import as_task
from structlearn.tasks.task_files import local_path
from structlearn.tasks.task_import import LeftOut, on_clock, read_source

KIND = "movement"


class Judgement(NamedTuple):
    """Recordings that the import refuses, with the reasons, and what it leaves out of others, by subject."""

    refused: Mapping[str, str]
    remarks: Mapping[str, tuple[str, ...]]


def judge(entry: Mapping[str, Any], names: Collection[str]) -> Judgement:
    """Read all recordings of an entry, of these names, as its import would, without those that fail.

    What else the import leaves out, such as copies in a LeRobotDataset, is a remark on the source.
    """
    segment = {**entry["segment"], "skip_failures": True}
    left_out, remarks = LeftOut(), dict[str, dict[str, None]]()
    try:
        task = as_task(KIND, {**entry, "segment": segment}, Path(entry["source"]), "the proposed entry")
        recordings = read_source(task, task.source, left_out, module_of(KIND, "recordings").read)
        for run in on_clock(task, recordings, task.clock, left_out):
            for subject in ("joints", "orientation"):
                if said := run.provenance.get(subject):
                    remarks.setdefault(subject, {})[said] = None
    except InputError as error:
        if not left_out:  # the import stops before it reads any
            left_out = dict.fromkeys(names, str(error))
    left_out = _by_recording(entry["source"], left_out)
    remarks["source"] = dict.fromkeys(reason for name, reason in left_out.items() if name not in names)
    refused = {name: reason for name, reason in left_out.items() if name in names}
    return Judgement(refused, {subject: tuple(said) for subject, said in remarks.items() if said})


def reasons(refused: Iterable[str], most: int = 3) -> str:
    """Different reasons in one line, with the number of those that are not named."""
    different = list(dict.fromkeys(refused))
    more = f"; and {len(different) - most} more" if len(different) > most else ""
    return "; ".join(different[:most]) + more


def _by_recording(source: str, left_out: LeftOut) -> dict[str, str]:
    """Reasons by the names of recordings: the import names some by their files."""
    names = {}
    try:
        for file in recording_files(local_path(source)):
            names[f"{file.path.parent.name}/{file.path.name}"] = file.name
    except InputError:  # not a source of bags
        pass
    return {names.get(file, file): reason for file, reason in left_out.items()}
