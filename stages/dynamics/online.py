"""Learn online: once through the sines without shuffling (figure III.2), and a payload picked up mid-way."""

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.online_learning import OnlineParameters, follow_payload, learn_once_through
from structlearn.simulation.arm import ArmParameters

RAW = "data/raw/dynamics"


def main() -> None:
    parameters = stage_parameters("online", OnlineParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    sines, loaded = (read_joint_log(f"{RAW}/{name}/log.mcap") for name in ("iiwa", "payload"))
    errors = learn_once_through(robot.tree, _motion(sines), parameters)
    dt = loaded.time[-1] / (len(loaded.time) - 1)
    payload = follow_payload(robot.tree, robot.inertias, _motion(loaded), dt, parameters.payload)
    with publish("data/dynamics/online") as folder:
        folder.mkdir()
        write_table(errors, folder / "errors.parquet")
        write_table(payload, folder / "payload.parquet")


def _motion(log: JointLog) -> Motion:
    return measured_motion(log.name, log.time, log.positions, log.velocities, log.torques)


if __name__ == "__main__":
    run(main)
