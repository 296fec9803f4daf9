"""Check a skill against the robot that is to run it."""

from structlearn.core.artefacts import publish
from structlearn.feedback.skill_file import read_skill
from structlearn.tasks.movement.check_results import check_lines, write_check
from structlearn.tasks.movement.parameters import RobotParameters
from structlearn.tasks.movement.skill_check import check_skill
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    missing = "robot" if not files.has("robot") else "" if files.skill.exists() else "skill"
    if missing:
        with publish(files.folder / "check") as folder:
            leave_out(folder, f"The task has no {missing}.")
    else:
        robot = files.entry(RobotParameters, "robot")
        check = check_skill(read_skill(files.skill), robot)
        write_check(check, files.folder / "check")
        print(check_lines(check)[-1])


if __name__ == "__main__":
    run_for_task(main, "check")
