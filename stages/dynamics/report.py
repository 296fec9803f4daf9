"""Report of the dynamics testbed: figures, tables, findings and their page."""

import pandas as pd

from dissertation.dynamics import files
from dissertation.dynamics.page.figures import arm_still, drawings
from dissertation.dynamics.page.findings import (
    ROBOTS_STUDY,
    STUDIED,
    DynamicsResults,
    agreement_with_pinocchio,
    findings,
    friction_table,
    known_errors,
    residual_torques,
)
from dissertation.dynamics.page.page import dynamics_page
from dissertation.dynamics.protocol.tracking import TrackingParameters
from dissertation.dynamics.protocol.trainings import (
    PUBLISHED,
    DynamicsTrainingParameters,
    OnlineParameters,
)
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    RecordMotionParameters,
    perturbed_mechanics,
)
from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import extended, read_study
from dissertation.simulation.arm import ArmParameters
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.rigid_body.model_names import COULOMB, ROBOT
from structlearn.rigid_body.robot import read_urdf
from structlearn.rigid_body.urdf import urdf_path

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

FRICTION_MODELS = ("cov", f"cov{COULOMB}")


def main() -> None:
    chosen = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    arm, robot = chosen["arm"], chosen["arm"].read()
    known, friction, residuals = [], [], []
    for name, log in files.read_logs(ROBOT).items():
        seed, motion = int(name), files.as_motion(log, chosen["train_dynamics"].smoothing_hz)
        true = perturbed_mechanics(robot.tree, robot.inertias, chosen["perturbed_robot"], seed)
        learned = files.read_robot_models(seed, FRICTION_MODELS, PUBLISHED)
        known.append(known_errors(robot, true, motion).assign(seed=seed))
        friction.append(friction_table(learned, true).assign(seed=seed))
        if not residuals:
            rate_hz = 1.0 / files.step_s(log)
            residuals.append(residual_torques(robot, learned[FRICTION_MODELS[-1]], motion, rate_hz))
    agreement = [
        {"robot": name} | agreement_with_pinocchio(read_urdf(urdf_path(name), locked))
        for name, locked in (COMPARED | {arm.urdf: arm.locked_joints}).items()
    ]
    study = read_study(ROBOTS_STUDY)
    tables = files.read_tables() | {"known": pd.concat(known, ignore_index=True)}
    results = DynamicsResults(
        **tables | {name: extended(tables[name], study, name) for name in STUDIED},
        agreement=pd.DataFrame(agreement),
        friction=pd.concat(friction, ignore_index=True),
        residuals=residuals[0],
        chosen=chosen,
        study=study,
    )
    still = arm_still(str(urdf_path(arm.urdf)), robot.tree, chosen["arm_motion"].used)
    find = findings(results)
    page = dynamics_page(results, find)
    drawn = {"still": still, **drawings(results)}
    publish_judged("reports/dynamics", {"index": page}, drawn, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
