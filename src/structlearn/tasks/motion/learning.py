"""Identification of the arm of a task from its joint logs (III.4)."""

from pathlib import Path
from shutil import rmtree

from structlearn.core.errors import InputError
from structlearn.rigid_body.log_fitness import fitness_lines
from structlearn.tasks.motion.joint_motion import learn_motion, read_arm
from structlearn.tasks.motion.parameters import MotionParameters, read_logs
from structlearn.tasks.motion.repeated_motion import repeat_lines
from structlearn.tasks.task_files import TaskFiles, is_public, leave_out


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `learn_motion`, models and the identified URDF."""
    parameters = files.entry(MotionParameters)
    logs = read_logs(files.recorded / "logs.parquet", parameters)
    try:
        robot, urdf = read_arm(parameters)
        _, tables = learn_motion(robot, logs, parameters, urdf, folder)
        if "fitness" in tables:
            lines = [*fitness_lines(tables["fitness"]), *repeat_lines(tables["repeats"])]
            print("Fit to identify the arm from?", *lines, sep="\n")
    except InputError as error:
        if not is_public(parameters.source):
            raise
        rmtree(folder)
        leave_out(folder, str(error))
