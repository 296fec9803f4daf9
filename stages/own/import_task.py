"""Check a task's entry and take over its recordings; it always runs, and what it writes decides the rest."""

from collections.abc import Mapping
from pathlib import Path

from structlearn.ground.artefacts import publish
from structlearn.recordings import read_recordings, write_recordings
from structlearn.recordings.settings import setting_folders
from structlearn.testbeds.own.files import TaskFiles, leave_out, local_path, run_for_task
from structlearn.testbeds.own.task import read_task, write_task


def main(files: TaskFiles) -> None:
    task = read_task(files.name)
    sets: dict[str, Mapping[str, Path]] = {"demonstrations": {}, "executions": {}, "corrections": {}}
    if task.source is not None:
        sets["demonstrations"] = {"": local_path(task.source)}
    if task.feedback is not None:
        sets["executions"] = {"": local_path(task.feedback.executions)}
        sets["corrections"] = setting_folders(task.feedback.corrections, task.feedback.settings)
    read = {
        kind: {name: read_recordings(source, task.topics, task.stamps) for name, source in folders.items()}
        for kind, folders in sets.items()
    }
    write_task(task, files.parameters)
    for kind, by_name in read.items():
        with publish(files.folder / kind) as target:
            if not by_name:
                leave_out(target, kind)
            for name, recordings in by_name.items():
                write_recordings(recordings, target / name)


if __name__ == "__main__":
    run_for_task(main)
