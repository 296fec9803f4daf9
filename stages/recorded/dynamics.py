"""Identify a recorded Panda, with and without Coulomb friction; torques of another arm's slides (III.4)."""

from pathlib import Path

from structlearn.core.artefacts import filled, publish, write_table
from structlearn.core.errors import MissingInputError
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.readers import synchronise
from structlearn.rigid_body.tree import read_urdf
from structlearn.simulation.arm import urdf_path
from structlearn.tasks.motion.joint_motion import arm_of, learn_motion, logs_of
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.slide_torques import ARM, CUTOFF_HZ, RATE_HZ, torque_check
from structlearn.tasks.public.public_files import RecordedFiles


def panda(folder: Path) -> None:
    parameters = stage_parameters("recorded_dynamics", MotionParameters, PARAMETER_FILE)
    filled(parameters.source)
    robot, urdf = arm_of(parameters)
    learn_motion(robot, logs_of(parameters, robot.tree), parameters, urdf, folder)


def slide_torques(folder: Path) -> None:
    slides = [synchronise(one, RATE_HZ) for one in RecordedFiles().streams("slides")]
    torques, payloads = torque_check(read_urdf(urdf_path(ARM)), slides, CUTOFF_HZ)
    write_table(torques, folder / "slide_torques.parquet")
    write_table(payloads, folder / "slide_payloads.parquet")


def main() -> None:
    missing = []
    with publish("data/recorded/dynamics") as folder:
        folder.mkdir()
        for find in (panda, slide_torques):
            try:
                find(folder)
            except MissingInputError as error:
                missing.append(str(error))
                print(f"without {error}")
        if len(missing) == 2:
            raise MissingInputError("; ".join(missing))


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/dynamics"))
