"""Identify a recorded arm, with and without Coulomb friction; torques of another one's slides (III.4)."""

import pandas as pd

from structlearn.ground.artefacts import filled, publish, write_table
from structlearn.ground.errors import MissingInputError
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.recordings import synchronise
from structlearn.recordings.joint_log import read_log_table
from structlearn.rigid_body.dynamics_models import DynamicsModels, write_dynamics_models
from structlearn.rigid_body.learner import LearningParameters
from structlearn.rigid_body.tree import read_urdf
from structlearn.simulation.arm import urdf_path
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.files import RecordedFiles
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedDynamicsParameters
from structlearn.testbeds.recorded.protocol.panda_identification import identify, panda_motion
from structlearn.testbeds.recorded.protocol.slide_torques import ARM, CUTOFF_HZ, RATE_HZ, torque_check

Found = tuple[dict[str, DynamicsModels], dict[str, pd.DataFrame]]
"""Models and tables by name."""


def identified() -> Found:
    """Of the first motion of the Panda."""
    parameters = stage_parameters("recorded_dynamics", RecordedDynamicsParameters, PARAMETER_FILE)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    log = read_log_table(filled("data/raw/recorded/panda") / "logs.parquet")[0]
    panda = read_urdf(urdf_path(parameters.urdf), parameters.locked_joints)
    models, results = identify(panda, panda_motion(log, parameters), parameters, learning)
    return models, vars(results)


def slide_torques() -> Found:
    """Of all slides."""
    slides = [synchronise(one, RATE_HZ) for one in RecordedFiles().streams("slides")]
    torques, payloads = torque_check(read_urdf(urdf_path(ARM)), slides, CUTOFF_HZ)
    return {}, {"slide_torques": torques, "slide_payloads": payloads}


def main() -> None:
    models, tables, missing = {}, {}, []
    for find in (identified, slide_torques):
        try:
            its_models, its_tables = find()
        except MissingInputError as error:
            missing.append(str(error))
        else:
            models, tables = models | its_models, tables | its_tables
    if not tables:
        raise MissingInputError("; ".join(missing))
    for message in missing:
        print(f"without {message}")
    with publish("data/recorded/dynamics") as folder:
        folder.mkdir()
        for name, learned in models.items():
            write_dynamics_models(learned, folder / "models" / f"{name}.safetensors")
        for name, table in tables.items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/dynamics"))
