"""Hold a skill against the robot that is to run it."""

from structlearn.core.artefacts import publish
from structlearn.feedback.skill_file import read_skill
from structlearn.tasks.movement.check_results import write_check
from structlearn.tasks.movement.movement_parameters import RobotParameters
from structlearn.tasks.movement.skill_check import check_skill
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    if not files.skill.exists():
        with publish(files.folder / "check") as folder:
            leave_out(folder, "The task has no skill.")
        return
    skill = read_skill(files.skill)
    write_check(check_skill(skill, files.part("robot", RobotParameters)), files.folder / "check")


if __name__ == "__main__":
    run_for_task(main, "robot", "check")
