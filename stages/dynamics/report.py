"""Report of the dynamics testbed: figures, tables, findings and their page."""

from dissertation.dynamics import files
from dissertation.dynamics.page.figures import arm_still, drawings
from dissertation.dynamics.page.findings import findings
from dissertation.dynamics.page.page import ROBOTS_STUDY, dynamics_page
from dissertation.dynamics.protocol.tracking import TrackingParameters
from dissertation.dynamics.protocol.training_choice import TABLE
from dissertation.dynamics.protocol.trainings import CHOSEN, DynamicsTrainingParameters, OnlineParameters
from dissertation.dynamics.protocol.truth import FRICTION_MODELS, agreement_with_pinocchio, residual_torques
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import PerturbedRobotParameters, RecordMotionParameters
from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.results import read_results, with_study
from dissertation.evidence.studies import OURS, RESULTS, stored_study
from dissertation.simulation.arm import ArmParameters
from structlearn.core.artefacts import read_csv
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.model_names import ROBOT
from structlearn.rigid_body.robot import read_urdf

import pandas as pd

PARAMETERS = {
    "arm": ArmParameters,
    "dynamics_robots": Population,
    "arm_motion": ArmMotionParameters,
    "perturbed_robot": PerturbedRobotParameters,
    "record_motion": RecordMotionParameters,
    "train_dynamics": DynamicsTrainingParameters,
    "track": TrackingParameters,
    "online": OnlineParameters,
}
COMPARED = {
    "kuka_iiwa/model.urdf": (),
    "franka_panda/panda.urdf": ("panda_finger_joint2",),  # mimics the other finger
    "xarm/xarm6_robot.urdf": (),
}
"""Robots of pybullet_data compared with Pinocchio, and their locked joints."""


def main() -> None:
    chosen = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    arm, robot = chosen["arm"], chosen["arm"].read()
    raw = files.read_tables() | {"choice": read_csv(TABLE)}
    (seed, log), *_ = files.read_logs(ROBOT).items()
    motion = files.as_motion(log, chosen["train_dynamics"].smoothing_hz)
    learned = files.read_robot_models(int(seed), FRICTION_MODELS[-1:], CHOSEN)[FRICTION_MODELS[-1]]
    raw["residuals"] = residual_torques(robot, learned, motion, 1.0 / files.step_s(log))
    agreement = [
        {"robot": name} | agreement_with_pinocchio(read_urdf(urdf_path(name), locked))
        for name, locked in (COMPARED | {arm.urdf: arm.locked_joints}).items()
    ]
    raw["agreement"] = pd.DataFrame(agreement)
    folder = RESULTS / ROBOTS_STUDY
    study = stored_study(folder) if folder.exists() else None
    population = with_study(read_results("dynamics"), study, "seed", None, variant=OURS)
    find = findings(population, raw["agreement"][["regressor_n_m", "compiled_n_m"]].max(axis=1))
    page = dynamics_page(population, find, raw, chosen, study)
    still = arm_still(str(urdf_path(arm.urdf)), robot.tree, chosen["arm_motion"].used)
    drawn = drawings(population.results, still, raw, chosen)
    publish_judged("reports/dynamics", {"index": page}, drawn, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
