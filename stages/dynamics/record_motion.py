"""Record arms on sines: as in the URDF, stand-ins, and with a payload (III.4)."""

from functools import partial
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.parallel import parallel_map
from structlearn.ground.populations import Population
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, write_joint_log
from structlearn.rigid_body.model_names import IDEAL, ROBOT
from structlearn.simulation.arm import ArmParameters
from structlearn.testbeds.dynamics.world.arm_motion import ArmMotionParameters
from structlearn.testbeds.dynamics.world.joint_logs import (
    RecordMotionParameters,
    compared_log,
    ideal_log,
    payload_log,
    stand_in_log,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

RAW = "data/raw/dynamics"


def main() -> None:
    parameters = stage_parameters("record_motion", RecordMotionParameters)
    motion = stage_parameters("arm_motion", ArmMotionParameters).used
    stand_ins = stage_parameters("stand_in", StandInParameters)
    arm = stage_parameters("arm", ArmParameters)
    robot = arm.read()
    logs = {IDEAL: partial(ideal_log, robot)}
    for seed in stage_parameters("dynamics_robots", Population).test:
        logs[f"payload/{seed}"] = partial(payload_log, robot, stand_ins, seed, parameters.payload)
        logs[f"{ROBOT}/{seed}"] = partial(stand_in_log, robot, stand_ins, seed)
    record = partial(compared_log, motion=motion, engine=arm.engine)
    made = dict(zip(logs, parallel_map(record, logs.values(), "logs"), strict=True))
    for kind in (IDEAL, ROBOT, "payload"):
        with publish(f"{RAW}/{kind}") as folder:
            for name in (name for name in made if name.split("/")[0] == kind):
                _write(*made[name], folder / name.removeprefix(kind).lstrip("/"))


def _write(log: JointLog, agreement: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_joint_log(log, folder / "log.mcap")
    write_table(agreement, folder / "agreement.parquet")


if __name__ == "__main__":
    run(main)
