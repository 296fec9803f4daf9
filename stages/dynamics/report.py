"""Publish the report of the dynamics testbed: its page, figures, tables and findings."""

import pandas as pd

from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.claims import quoted_claims
from structlearn.reporting.publishing import publish_report
from structlearn.reporting.studies import extended, read_study
from structlearn.rigid_body.model_names import COULOMB, ROBOT
from structlearn.rigid_body.newton_euler import agreement_with_pinocchio
from structlearn.rigid_body.tree import read_urdf
from structlearn.simulation.arm import ArmParameters, urdf_path
from structlearn.testbeds.dynamics import files
from structlearn.testbeds.dynamics.page.figures import arm_still, drawings
from structlearn.testbeds.dynamics.page.findings import (
    ROBOTS_STUDY,
    STUDIED,
    DynamicsResults,
    findings,
    friction_table,
    known_errors,
    residual_torques,
)
from structlearn.testbeds.dynamics.page.page import dynamics_page
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.protocol.trainings import (
    PUBLISHED,
    DynamicsTrainingParameters,
    OnlineParameters,
)
from structlearn.testbeds.dynamics.world.arm_motion import ArmMotionParameters
from structlearn.testbeds.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    RecordMotionParameters,
    perturbed_mechanics,
)

PARAMETERS = {
    "arm": ArmParameters,
    "dynamics_robots": Population,
    "arm_motion": ArmMotionParameters,
    "stand_in": PerturbedRobotParameters,
    "record_motion": RecordMotionParameters,
    "train_dynamics": DynamicsTrainingParameters,
    "track": TrackingParameters,
    "online": OnlineParameters,
}
COMPARED = {
    "kuka_iiwa/model.urdf": (),
    "franka_panda/panda.urdf": ("panda_finger_joint2",),  # it follows the other finger
    "xarm/xarm6_robot.urdf": (),
}
"""Robots of pybullet_data, with their locked joints."""

FRICTION_MODELS = ("cov", f"cov{COULOMB}")


def main() -> None:
    chosen = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    arm, robot = chosen["arm"], chosen["arm"].read()
    known, friction, residuals = [], [], []
    for name, log in files.read_logs(ROBOT).items():
        seed, motion = int(name), files.as_motion(log, chosen["train_dynamics"].smoothing_hz)
        true = perturbed_mechanics(robot.tree, robot.inertias, chosen["stand_in"], seed)
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
    publish_report("reports/dynamics", {"index": page}, drawn, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
