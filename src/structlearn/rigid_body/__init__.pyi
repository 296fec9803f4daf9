from .base_parameters import BaseFit as BaseFit, BaseParameters as BaseParameters, fit_base as fit_base
from .dynamics_models import (
    DynamicsModels as DynamicsModels,
    read_dynamics_models as read_dynamics_models,
    write_dynamics_models as write_dynamics_models,
)
from .identification import fit_structure as fit_structure, unconstrained_minimiser as unconstrained_minimiser
from .inertia_parameters import link_inertias as link_inertias, sample_parameters as sample_parameters
from .arm_kinematics import Arm as Arm, Follower as Follower, follow as follow, read_arm as read_arm
from .motion import Motion as Motion, measured_motion as measured_motion
from .network_models import (
    StackedLagrangianNetworks as StackedLagrangianNetworks,
    StackedPerceptrons as StackedPerceptrons,
)
from .regressor import link_parameters as link_parameters, torque_regressor as torque_regressor
from .robot import Robot as Robot, read_urdf as read_urdf
from .tree import KinematicTree as KinematicTree, LinkInertias as LinkInertias
from .urdf import write_urdf as write_urdf
