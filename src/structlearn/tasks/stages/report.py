"""Report page of a task."""

from structlearn.tasks.task_files import run_for_task
from structlearn.tasks.task_page import publish_page

if __name__ == "__main__":
    run_for_task(publish_page)
