"""Report page of a public set."""

from dissertation.recorded.set_page import publish_set
from structlearn.tasks.task_files import run_for_task

if __name__ == "__main__":
    run_for_task(publish_set)
