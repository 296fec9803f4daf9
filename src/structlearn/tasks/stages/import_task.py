"""Check a task's entry and import its recordings; always runs, and later stages depend on what it writes."""

from structlearn.tasks.task_entry import read_task, source_digests, write_task
from structlearn.tasks.task_files import TaskFiles, run_for_task
from structlearn.tasks.task_import import import_task


def main(files: TaskFiles) -> None:
    task = read_task(files.name)
    digests = source_digests(task)
    import_task(task, files.recorded)
    write_task(task, digests, files.parameters)


if __name__ == "__main__":
    run_for_task(main)
