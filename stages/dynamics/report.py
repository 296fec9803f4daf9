"""The report of the dynamics testbed: figures, tables, metrics and the page that shows them."""

import pandas as pd

from structlearn.ground.artefacts import read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import read_joint_log
from structlearn.reporting.page import Link
from structlearn.reporting.publishing import publish_report
from structlearn.rigid_body.agreement import agreement_with_pinocchio
from structlearn.rigid_body.model_files import read_dynamics_models
from structlearn.rigid_body.model_names import COULOMB
from structlearn.rigid_body.motion import measured_motion
from structlearn.rigid_body.online_learning import OnlineParameters
from structlearn.rigid_body.seeded_training import DynamicsTrainingParameters
from structlearn.rigid_body.tree import read_urdf
from structlearn.simulation.arm import ArmParameters, urdf_path
from structlearn.testbeds.dynamics.page.dynamics_page import dynamics_page
from structlearn.testbeds.dynamics.page.dynamics_results import DynamicsResults, metrics
from structlearn.testbeds.dynamics.page.dynamics_robot import friction_table, known_errors, residual_torques
from structlearn.testbeds.dynamics.page.dynamics_sections import pictures
from structlearn.testbeds.dynamics.page.dynamics_tables import tables
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import SIMULATED, MotionSourceParameters
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, stand_in

DATA = "data/dynamics"
PARAMETERS = {
    "arm": ArmParameters,
    "arm_motion": SineParameters,
    "stand_in": StandInParameters,
    "record_motion": MotionSourceParameters,
    "train_dynamics": DynamicsTrainingParameters,
    "track": TrackingParameters,
    "online": OnlineParameters,
}
COMPARED = ("kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "xarm/xarm6_robot.urdf")
FRICTION_MODELS = ("cov", f"cov{COULOMB}")
TABLES = {
    "errors": "models/errors",
    "outcomes": "models/outcomes",
    "links": "models/links",
    "base": "models/base_parameters",
    "scores": "tracking/scores",
    "paths": "tracking/paths",
    "online": "online/errors",
    "payload": "online/payload",
}
RECORDINGS = {
    "reaches": "the arm reaches with the ground truth and with learned models",
    "robot_reaches": "likewise the stand-in for the robot, with the default model and learned ones",
    "torques": "the robot along its sines: measured torques beside those of models",
    "payload": "the arm picks up a payload and learns it on the way",
}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    robot = parameters["arm"].read()
    simulated = parameters["record_motion"].source == SIMULATED
    mechanics = stand_in(robot.tree, robot.inertias, parameters["stand_in"]) if simulated else None
    log = read_joint_log("data/raw/dynamics/stand_in/log.mcap")
    signals = (log.time, log.positions, log.velocities, log.torques)
    motion = measured_motion(log.name, *signals, cutoff_hz=parameters["train_dynamics"].smoothing_hz)
    rate_hz = (len(motion) - 1) / (log.time[-1] - log.time[0])
    folder = f"{DATA}/models/stand_in/{parameters['track'].loss}"
    learned = {name: read_dynamics_models(f"{folder}/{name}.safetensors") for name in FRICTION_MODELS}
    compared = dict.fromkeys([*COMPARED, parameters["arm"].urdf])
    agreement = [{"robot": name} | agreement_with_pinocchio(read_urdf(urdf_path(name))) for name in compared]
    results = DynamicsResults(
        **{name: read_table(f"{DATA}/{file}.parquet") for name, file in TABLES.items()},
        agreement=pd.DataFrame(agreement),
        known=known_errors(robot, mechanics, motion),
        friction=friction_table(learned, mechanics),
        residuals=residual_torques(robot, learned[FRICTION_MODELS[-1]], motion, rate_hz),
        stand_in=parameters["stand_in"] if simulated else None,
        motion=parameters["arm_motion"],
        training=parameters["train_dynamics"],
        learning_online=parameters["online"],
        tracking=parameters["track"],
        carried=parameters["record_motion"].payload,
    )
    links = [
        Link(f"../recordings/dynamics/{name}.rrd", f"{name}.rrd", note)
        for name, note in RECORDINGS.items()
        if simulated or name != "robot_reaches"
    ]
    publish_report(
        "reports/dynamics",
        pictures(results),
        tables(results),
        metrics(results),
        lambda sizes: dynamics_page(results, sizes, parameters, links),
    )


if __name__ == "__main__":
    run(main)
