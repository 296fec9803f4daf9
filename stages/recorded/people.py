"""How recorded people differ, by their reaches past boxes and repeats of one reach."""

from dissertation.recorded.people import PEOPLE, people_who_differ
from structlearn.core.artefacts import write_csv
from structlearn.core.stage import run
from structlearn.tasks.task_files import TaskFiles


def main() -> None:
    write_csv(people_who_differ(TaskFiles("boxes"), TaskFiles("reaches")), PEOPLE)


if __name__ == "__main__":
    run(main)
