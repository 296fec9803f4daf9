"""Identify a recorded arm, with and without Coulomb friction; torques of another one's slides (III.4)."""

from dataclasses import fields

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.recordings.joint_log import read_joint_log
from structlearn.rigid_body.model_files import write_dynamics_models
from structlearn.rigid_body.model_learning import LearningParameters
from structlearn.rigid_body.tree import read_urdf
from structlearn.simulation.arm import urdf_path
from structlearn.testbeds.recorded.protocol.panda_identification import identify, panda_motion
from structlearn.testbeds.recorded.protocol.panda_parameters import RecordedDynamicsParameters
from structlearn.testbeds.recorded.protocol.slide_torques import ARM, CUTOFF_HZ, RATE_HZ, torque_check


def main() -> None:
    parameters = stage_parameters("recorded_dynamics", RecordedDynamicsParameters)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    panda = read_urdf(urdf_path(parameters.urdf), parameters.locked_joints)
    log = read_joint_log("data/raw/recorded/panda/exciting_trajectory.mcap")
    models, results = identify(panda, panda_motion(log, parameters), parameters, learning)
    slides = read_demonstrations("data/raw/recorded/slides", rate_hz=RATE_HZ)
    torques, payloads = torque_check(read_urdf(urdf_path(ARM)), slides, CUTOFF_HZ)
    with publish("data/recorded/dynamics") as folder:
        folder.mkdir()
        for name, learned in models.items():
            write_dynamics_models(learned, folder / "models" / f"{name}.safetensors")
        for field in fields(results):
            write_table(getattr(results, field.name), folder / f"{field.name}.parquet")
        write_table(torques, folder / "slide_torques.parquet")
        write_table(payloads, folder / "slide_payloads.parquet")


if __name__ == "__main__":
    run(main)
