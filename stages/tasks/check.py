"""Hold a skill against the robot that is to run it."""

from structlearn.feedback.skill_file import read_skill
from structlearn.tasks.own.protocol.arm_parameters import RobotParameters
from structlearn.tasks.own.protocol.check_results import write_check
from structlearn.tasks.own.protocol.skill_check import check_skill
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    skill = read_skill(files.skill)
    write_check(check_skill(skill, files.part("robot", RobotParameters)), files.folder / "check")


if __name__ == "__main__":
    run_for_task(main, "robot", "check")
