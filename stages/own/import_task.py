"""Check a task's entry and read its recordings once; it always runs, and what it writes decides the rest."""

from structlearn.core.artefacts import publish, write_table
from structlearn.readers.runs import write_runs
from structlearn.tasks.own.protocol.task_import import came_in, task_runs
from structlearn.tasks.task_entry import read_task, source_digests, write_task
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    task = read_task(files.name)
    digests = source_digests(task)
    recordings, runs = task_runs(task)
    write_task(task, digests, files.parameters)
    write_table(came_in(recordings), files.folder / "came_in.parquet")
    for kind, by_name in runs.items():
        with publish(files.folder / kind) as target:
            if not by_name:
                leave_out(target, kind)
            else:
                target.mkdir()
            for name, its in by_name.items():
                write_runs(its, target / f"{name}.parquet")


if __name__ == "__main__":
    run_for_task(main)
