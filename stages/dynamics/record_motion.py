"""Record arms on sines: the URDF's arm, and perturbed robots without and with a payload picked up (III.4)."""

from functools import partial
from operator import call

from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    RecordMotionParameters,
    ideal_log,
    perturbed_robot,
    perturbed_robot_log,
)
from dissertation.simulation.arm import ArmParameters
from structlearn.core.artefacts import publish
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.bag_recording import write_joint_log
from structlearn.rigid_body.model_names import IDEAL, ROBOT


def main() -> None:
    parameters = stage_parameters("record_motion", RecordMotionParameters)
    motion = stage_parameters("arm_motion", ArmMotionParameters).used
    perturbed = stage_parameters("perturbed_robot", PerturbedRobotParameters)
    arm = stage_parameters("arm", ArmParameters)
    robot = arm.read()
    # the first log is made in this process, which compiles the arm once instead of once per worker
    made = {f"{IDEAL}/{IDEAL}": ideal_log(robot, motion)}
    logs = {}
    for seed in stage_parameters("dynamics_robots", Population).test:
        log = partial(perturbed_robot_log, robot, perturbed_robot(perturbed, seed), motion)
        logs |= {f"payload/{seed}": partial(log, parameters.payload), f"{ROBOT}/{seed}": log}
    made |= dict(zip(logs, parallel_map(call, logs.values(), "logs"), strict=True))
    with publish("data/raw/dynamics") as folder:
        for name, log in made.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_joint_log(log, folder / f"{name}.mcap")


if __name__ == "__main__":
    run(main)
