"""Identify a recorded UR10e from its motors' currents, and weigh the load that it carries (III.4)."""

from dataclasses import fields

from structlearn.ground.artefacts import filled, publish, write_table
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.recordings.joint_log import DriveLog, read_log_table
from structlearn.recordings.ur10e import URDF
from structlearn.rigid_body.arm_identification import write_identified
from structlearn.rigid_body.dynamics_models import write_dynamics_models
from structlearn.rigid_body.learner import LearningParameters
from structlearn.rigid_body.tree import read_urdf
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedUr10eParameters
from structlearn.testbeds.recorded.protocol.ur10e_identification import identify_ur10e


def main() -> None:
    parameters = stage_parameters("recorded_ur10e", RecordedUr10eParameters, PARAMETER_FILE)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    raw = filled("data/raw/recorded/ur10e")
    logs = {log.name: log for log in read_log_table(raw / "logs.parquet", DriveLog)}
    robot = read_urdf(raw / URDF)
    identified, results = identify_ur10e(robot, logs, parameters, learning)
    with publish("data/recorded/ur10e") as folder:
        folder.mkdir()
        for (kind, friction), models in identified.models.items():
            write_dynamics_models(models, folder / f"models/{kind}_{friction}.safetensors")
        for field in fields(results):
            write_table(getattr(results, field.name), folder / f"{field.name}.parquet")
        written = write_identified(raw / URDF, folder / "identified.urdf", robot, identified)
        write_table(written, folder / "written.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/ur10e"))
