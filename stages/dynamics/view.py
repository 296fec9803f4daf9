"""Recordings to look at: the arm reaching with each model, torques of the robot, and the payload (III.4)."""

import numpy as np

from structlearn.ground.artefacts import publish, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.model_files import read_dynamics_models
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.seeded_training import DynamicsTrainingParameters
from structlearn.simulation.arm import ArmParameters, urdf_path
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.recordings.payload import write_payload
from structlearn.testbeds.dynamics.recordings.reaches_recording import write_reaches
from structlearn.testbeds.dynamics.recordings.shown_motions import (
    DynamicsViewParameters,
    ShownPayload,
    reaching,
    shown_torques,
)
from structlearn.testbeds.dynamics.recordings.torques import write_torques
from structlearn.testbeds.dynamics.world.joint_logs import SIMULATED, MotionSourceParameters

RAW, DATA = "data/raw/dynamics", "data/dynamics"


def main() -> None:
    chosen = stage_parameters("inspect_dynamics", DynamicsViewParameters)
    source = stage_parameters("record_motion", MotionSourceParameters)
    arm = stage_parameters("arm", ArmParameters)
    robot, urdf = arm.read(), urdf_path(arm.urdf)
    tree = robot.tree
    paths, scores = (read_table(f"{DATA}/tracking/{name}.parquet") for name in ("paths", "scores"))
    cutoff_hz = stage_parameters("train_dynamics", DynamicsTrainingParameters).smoothing_hz
    tracked = stage_parameters("track", TrackingParameters)
    motion, dt = _motion(read_joint_log(f"{RAW}/stand_in/log.mcap"), cutoff_hz)
    kept = slice(0, round(chosen.torques_s / dt), _thinning(dt, chosen.rate_hz))
    models = {
        name: read_dynamics_models(f"{DATA}/models/stand_in/{tracked.loss}/{name}.safetensors")
        for name in chosen.torque_models
    }
    torques = shown_torques(robot, motion.part(kept), dt * kept.step, models, tracked.reaching.tool_m)

    loaded = read_joint_log(f"{RAW}/payload/log.mcap")
    pick_up_s = source.payload.at_share * (loaded.time[-1] + loaded.time[1])
    near = np.flatnonzero(np.abs(loaded.time - pick_up_s) <= chosen.payload_s)
    near = near[:: _thinning(loaded.time[1], chosen.rate_hz)]
    learned = read_table(f"{DATA}/online/payload.parquet")
    learned = learned[(learned["time_s"] - pick_up_s).abs() <= chosen.payload_s]
    q, qd = loaded.positions[near], loaded.velocities[near]
    body = tool_motion(tree, source.payload.point_m, q, qd)[0]
    payload = ShownPayload(tree.names, loaded.time[near], q, body, pick_up_s, source.payload.mass_kg, learned)

    with publish("reports/recordings/dynamics") as folder:
        folder.mkdir()
        reaches = reaching(paths, scores, "iiwa", chosen.models, tree.names)
        write_reaches(folder / "reaches.rrd", urdf, tree.names, reaches, "Dynamics: reaches (simulated)")
        if source.source == SIMULATED:
            reaches = reaching(paths, scores, "stand_in", chosen.robot_models, tree.names)
            title = "Dynamics: reaches of the stand-in (simulated)"
            write_reaches(folder / "robot_reaches.rrd", urdf, tree.names, reaches, title)
        whose = "stand-in (simulated)" if source.source == SIMULATED else "robot"
        write_torques(folder / "torques.rrd", urdf, torques, f"Dynamics: torques of the {whose}")
        write_payload(folder / "payload.rrd", urdf, payload, "Dynamics: a payload picked up (simulated)")


def _motion(log: JointLog, cutoff_hz: float) -> tuple[Motion, float]:
    """The log as models learned from it, and its time step."""
    signals = (log.time, log.positions, log.velocities, log.torques)
    motion = measured_motion(log.name, *signals, cutoff_hz=cutoff_hz)
    return motion, float(log.time[-1]) / (len(motion) - 1)


def _thinning(dt: float, rate_hz: float) -> int:
    return max(1, round(1.0 / (dt * rate_hz)))


if __name__ == "__main__":
    run(main)
