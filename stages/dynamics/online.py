"""Learn online: one unshuffled pass through the sines (figure III.2), and payloads picked up mid-way."""

from functools import partial

from dissertation.dynamics.files import as_motion, read_logs, step_s
from dissertation.dynamics.protocol.trainings import OnlineParameters, learn_once_through
from dissertation.simulation.arm import ArmParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run, stage_parameters
from structlearn.rigid_body.dynamics_training import LearningParameters
from structlearn.rigid_body.model_names import IDEAL
from structlearn.rigid_body.payload import learn_payload

import pandas as pd


def main() -> None:
    parameters = stage_parameters("online", OnlineParameters)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    sines = as_motion(read_logs(IDEAL)[IDEAL])
    errors = learn_once_through(robot.tree, sines, parameters, learning)
    carrying = read_logs("payload")
    logs = [(as_motion(log), step_s(log)) for log in carrying.values()]
    learn = partial(learn_payload, tree=robot.tree, inertias=robot.inertias, parameters=parameters.payload)
    found = zip(carrying, parallel_map(learn, logs, "payloads"), strict=True)
    payload = pd.concat([table.assign(seed=int(name)) for name, table in found], ignore_index=True)
    with publish("data/dynamics/online") as folder:
        folder.mkdir()
        write_table(errors, folder / "errors.parquet")
        write_table(payload, folder / "payload.parquet")


if __name__ == "__main__":
    run(main)
