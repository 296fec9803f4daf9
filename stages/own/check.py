"""Check what a skill may ask of the robot: `make check TASK=pick` prints it and says whether all is well."""

from structlearn.feedback.skill_file import read_skill
from structlearn.ground.artefacts import publish, write_metrics, write_table
from structlearn.testbeds.own.files import TaskFiles, run_for_task
from structlearn.testbeds.own.protocol.robot_parameters import RobotParameters
from structlearn.testbeds.own.protocol.skill_check import check_skill


def main(files: TaskFiles) -> None:
    check = check_skill(read_skill(files.skill), files.part("robot", RobotParameters))
    with publish(files.folder / "check") as folder:
        folder.mkdir()
        write_table(check.margins, folder / "margins.parquet")
        write_metrics(check.metrics(), folder / "check.json")


if __name__ == "__main__":
    run_for_task(main, "robot", "check")
