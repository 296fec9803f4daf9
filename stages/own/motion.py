"""Identify the arm of a task from logs of its joints (dissertation III.4).

What loads slowly is imported where it is needed: most tasks have no such logs.
"""

from structlearn.ground.artefacts import publish, write_table
from structlearn.recordings.joint_log import read_joint_logs
from structlearn.recordings.stamps import StampPolicy
from structlearn.testbeds.own.files import TaskFiles, local_path, run_for_task
from structlearn.testbeds.own.protocol.arm_parameters import MotionParameters


def main(files: TaskFiles) -> None:
    from structlearn.rigid_body.dynamics_models import write_dynamics_models
    from structlearn.rigid_body.tree import read_urdf
    from structlearn.simulation.arm import urdf_path
    from structlearn.testbeds.own.protocol.own_motion import identify_own_arm

    parameters = files.part("motion", MotionParameters)
    urdf = urdf_path(str(local_path(parameters.urdf)))
    robot = read_urdf(urdf, parameters.locked_joints)
    stamps = files.part("stamps", StampPolicy)
    logs = read_joint_logs(local_path(parameters.source), parameters.topic, robot.tree.names, stamps)
    with publish(files.folder / "motion") as folder:
        folder.mkdir()
        identified, results = identify_own_arm(robot, logs, parameters, urdf, folder / "identified.urdf")
        for (kind, friction), models in identified.models.items():
            write_dynamics_models(models, folder / f"models/{kind}_{friction}.safetensors")
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run_for_task(main, "motion", "motion")
