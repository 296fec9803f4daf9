"""Hold a skill against the robot that is to run it."""

from structlearn.feedback.skill_file import read_skill
from structlearn.testbeds.own.files import TaskFiles, run_for_task
from structlearn.testbeds.own.protocol.arm_parameters import RobotParameters
from structlearn.testbeds.own.protocol.check_results import write_check
from structlearn.testbeds.own.protocol.skill_check import check_skill


def main(files: TaskFiles) -> None:
    skill = read_skill(files.skill)
    write_check(check_skill(skill, files.part("robot", RobotParameters)), files.folder / "check")


if __name__ == "__main__":
    run_for_task(main, "robot", "check")
