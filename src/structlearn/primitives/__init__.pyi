from .canonical import phase as phase, time_constant as time_constant
from .fitting import (
    FitParameters as FitParameters,
    cross_validation as cross_validation,
    learn_sequence as learn_sequence,
)
from .orientation import QuaternionPrimitive as QuaternionPrimitive, fit_quaternion as fit_quaternion
from .position import PositionPrimitive as PositionPrimitive, fit_position as fit_position
from .primitive_files import read_primitives as read_primitives, write_primitives as write_primitives
from .sequence import (
    PoseGoal as PoseGoal,
    PosePrimitive as PosePrimitive,
    SequencePath as SequencePath,
    unroll as unroll,
)
from .trajectory import (
    OrientationTrajectory as OrientationTrajectory,
    PathBase as PathBase,
    Trajectory as Trajectory,
    differentiated as differentiated,
)
from .twist_swing import TwistSwingPrimitive as TwistSwingPrimitive, fit_twist_swing as fit_twist_swing
from .vector import (
    VectorPrimitive as VectorPrimitive,
    expected_traces as expected_traces,
    fit_expected_traces as fit_expected_traces,
    fit_vector as fit_vector,
)
