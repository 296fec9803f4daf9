"""Print what checking a task's skill found: `make check TASK=pick`; exit code 1 where something fails."""

import sys

from structlearn.core.errors import InputError
from structlearn.tasks.movement.check_results import NO, SkillCheck, read_check
from structlearn.tasks.task_files import TaskFiles


def lines(check: SkillCheck) -> list[str]:
    """The worst of each quantity, and the verdict."""
    worst = check.worst("quantity").assign(margin_percent=lambda table: 100.0 * table["margin"])
    columns = ["quantity", "verdict", "margin_percent", "value", "bound", "unit", "where", "run", "time_s"]
    table = worst[columns].to_string(index=False, float_format="{:.3g}".format, na_rep="-")
    figures = check.metrics()
    verdict = (
        f"{check.verdict}: {figures['check_failing_runs']} of {figures['check_runs']} runs fail; "
        f"the nominal one: {figures['check_nominal']}"
    )
    slower = [f"durations x {check.stretch:.2f} would keep velocity, acceleration and jerk"]
    return [table, *check.notes, *(slower if check.stretch > 1.0 else []), verdict]


def main(files: TaskFiles) -> bool:
    """Print it; whether nothing fails.

    Raises:
        InputError: the task has no robot, or was not checked.
    """
    if files.kind != "movement" or not files.has("robot"):
        raise InputError(f"stages/tasks/own.yaml: {files.kind}.{files.name} has no robot to be checked on")
    check = read_check(files.folder / "check")
    print("\n".join(lines(check)))
    return check.verdict != NO


if __name__ == "__main__":
    try:
        sys.exit(0 if main(TaskFiles(sys.argv[1])) else 1)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
