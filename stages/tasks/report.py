"""Report page of a task."""

from structlearn.tasks.project import is_lab
from structlearn.tasks.task_entry import read_checked
from structlearn.tasks.task_files import TaskFiles, is_public, run_for_task
from structlearn.tasks.task_page import publish_page


def main(files: TaskFiles) -> None:
    if is_lab() or not is_public(read_checked(files.parameters).source):
        return publish_page(files)
    from dissertation.recorded.set_page import publish_set  # a lab's project has only the library

    return publish_set(files)


if __name__ == "__main__":
    run_for_task(main)
