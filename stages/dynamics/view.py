"""Rerun views: reaches with each model, joint torques of a perturbed robot, a payload picked up (III.4)."""

from dissertation.dynamics import files
from dissertation.dynamics import recordings as draw
from dissertation.dynamics.names import IDEAL, ROBOT, SHOWN_TRAINING
from dissertation.dynamics.protocol.tracking import TrackingParameters, tracked_reaches
from dissertation.dynamics.protocol.trainings import DynamicsTrainingParameters
from dissertation.dynamics.world.joint_logs import RecordMotionParameters
from dissertation.simulation.arm import ArmParameters
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.urdf_file import urdf_path
from structlearn.viewer.recording import publish_recordings


def main() -> None:
    chosen = stage_parameters("inspect_dynamics", draw.DynamicsViewParameters)
    carried = stage_parameters("record_motion", RecordMotionParameters).payload
    arm = stage_parameters("arm", ArmParameters)
    tracking = stage_parameters("track", TrackingParameters)
    robot, urdf = arm.read(), urdf_path(arm.urdf)
    names = robot.tree.names
    tables = files.read_tables("paths", "scores", "payload")
    reaches = {
        bed: tracked_reaches(tables["paths"], tables["scores"], bed, SHOWN_TRAINING, models, names)
        for bed, models in ((IDEAL, chosen.models), (ROBOT, chosen.robot_models))
    }
    (seed, log), *_ = files.read_logs(ROBOT).items()
    cutoff_hz = stage_parameters("train_dynamics", DynamicsTrainingParameters).smoothing_hz
    motion, dt = files.as_motion(log, cutoff_hz), files.step_s(log)
    models = files.read_robot_models(int(seed), chosen.torque_models, SHOWN_TRAINING)
    picking_up, *_ = files.read_logs("payload").values()
    learned = tables["payload"][tables["payload"]["seed"] == tables["payload"]["seed"].min()]
    perturbed = "Dynamics: reaches of the perturbed robot (simulated)"
    recordings = {
        "reaches": draw.reaches(urdf, names, reaches[IDEAL], "Dynamics: reaches (simulated)"),
        "robot_reaches": draw.reaches(urdf, names, reaches[ROBOT], perturbed),
        "torques": draw.torques(urdf, robot, motion, dt, models, tracking.reaching.tool_m, chosen),
        "payload": draw.payload(urdf, robot.tree, picking_up, learned, carried, chosen),
    }
    publish_recordings("reports/rerun/dynamics", recordings)


if __name__ == "__main__":
    run(main)
