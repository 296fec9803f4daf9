"""Identify the arm of a task from its joint logs (dissertation III.4).

Slow imports are inside `main`: it is not called for a public set that has not been fetched.
"""

from shutil import rmtree

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.tasks.motion.motion_parameters import MotionParameters, read_logs
from structlearn.tasks.task_files import TaskFiles, is_public, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    from dissertation.recorded.torque_parts import learn_parts
    from structlearn.rigid_body.log_fitness import fitness_lines
    from structlearn.tasks.motion.joint_motion import arm_of, learn_motion

    parameters = files.entry(MotionParameters)
    logs = read_logs(files.recorded / "logs.parquet", parameters)
    with publish(files.folder / "motion") as folder:
        try:
            if parameters.parts is not None:
                learn_parts(logs, parameters.parts, parameters.iterations, folder)
                return
            robot, urdf = arm_of(parameters)
            folder.mkdir()
            _, tables = learn_motion(robot, logs, parameters, urdf, folder)
            if "fitness" in tables:
                print("Fit to identify the arm from?", *fitness_lines(tables["fitness"]), sep="\n")
        except InputError as error:
            if not is_public(parameters.source):
                raise
            rmtree(folder, ignore_errors=True)
            leave_out(folder, str(error))


if __name__ == "__main__":
    run_for_task(main, out="motion")
