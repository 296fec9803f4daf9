"""Recorded reaches past obstacles."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from structlearn.readers import Recording
from structlearn.readers.bag_recording import each_recording
from structlearn.readers.demonstration import write_runs
from structlearn.tasks.obstacles.parameters import ObstacleParameters
from structlearn.tasks.task_import import LeftOut, on_clock, read_source, subfolders


def write(task: ObstacleParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `reaches`."""
    found = read_source(task, task.source, left_out, read)
    runs = on_clock(task, found, task.clock, left_out, refuse_jumps=False)  # the protocol reports jumps
    write_runs(runs, folder / "reaches.parquet")


def read(folder: Path, entry: Any, left_out: LeftOut) -> Iterator[Recording]:
    """Read reaches of a folder, each by its own person, or of its subfolders, one per person."""
    people = [path for path in subfolders(folder) if not (path / "metadata.yaml").exists()]  # not bags
    for one in people or [folder]:
        for reach in each_recording(one, entry.topics, entry.stamps):
            name, person = (f"{one.name} {reach.name}", one.name) if people else (reach.name, reach.name)
            yield replace(reach, name=name, provenance={**reach.provenance, "person": person})
