"""Dynamics and regressors of states of the iiwa: a call from Python for each, or one compiled for all.

Pinocchio's forward dynamics is its articulated-body algorithm; ours and MuJoCo's factorise the mass matrix.
All are compared at the same states, ours and the peers in double precision.
"""

from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np
from arm_motions import IIWA, SAMPLES, iiwa, relative_error
from timing import Case, Contender

from dissertation.simulation import compiled_chain
from dissertation.simulation.compiled_chain import ChainState
from structlearn.core.compilation import numba
from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.compiled_dynamics import InverseDynamics
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import RobotArrays, robot_arrays

SAME = 1e-9
MUJOCO = 1e-6  # it turns the URDF's inertias into principal axes, which the light wrist amplifies
StateFunction = Callable[..., np.ndarray]
"""Joint torques or accelerations (n,) of one state."""


def inverse_one_by_one() -> Case:
    """Torques of one state after the other, as a controller in Python asks for them."""
    robot, motion = iiwa()
    expected = _in_a_loop(_pinocchio(robot, "rnea"), motion)()
    contender = _contenders(motion, expected)
    return Case(
        work=f"inverse dynamics, {SAMPLES} states one by one",
        ours=contender(robot.inverse_dynamics),
        peers={
            "Pinocchio rnea": lambda: contender(_pinocchio(robot, "rnea")),
            "MuJoCo mj_inverse": lambda: contender(_mujoco("qacc", "mj_inverse", "qfrc_inverse")),
        },
        tolerance=MUJOCO,
        note="ours calls Pinocchio",
    )


def inverse_of_a_model() -> Case:
    """The same by arrays, the form that learned models have."""
    robot, motion = iiwa()
    expected = _in_a_loop(_pinocchio(robot, "rnea"), motion)()
    contender = _contenders(motion, expected)
    return Case(
        work="  by a compiled model",
        ours=contender(
            compiled_dynamics.from_python(compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias))
        ),
        peers={"Pinocchio rnea": lambda: contender(_pinocchio(robot, "rnea"))},
        tolerance=SAME,
        note="with friction; of learned models, and where Pinocchio is not installed",
    )


def inverse_batch() -> Case:
    """The same states in one call."""
    robot, motion = iiwa()
    expected = _in_a_loop(_pinocchio(robot, "rnea"), motion)()
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    return Case(
        work="  in one compiled call",
        ours=Contender(lambda: _torques(model, *motion), lambda found: relative_error(found, expected)),
        peers={
            "Pinocchio rneaInParallel": lambda: _pinocchio_batch("rneaInParallel", robot, motion, expected)
        },
        tolerance=SAME,
        note="ours by the function that compiled loops call at each of their steps, with friction; Pinocchio "
        "by a pool of one model, on one thread",
    )


def forward_one_by_one() -> Case:
    """Accelerations likewise, as a simulator in Python asks for them."""
    robot, motion, expected = _pushed()
    contender = _contenders(motion, expected)
    return Case(
        work=f"forward dynamics, {SAMPLES} states one by one",
        ours=contender(robot.forward_dynamics),
        peers={
            "Pinocchio aba": lambda: contender(_pinocchio(robot, "aba")),
            "MuJoCo mj_forward": lambda: contender(_mujoco("qfrc_applied", "mj_forward", "qacc")),
        },
        tolerance=MUJOCO,
        note="ours calls Pinocchio",
    )


def forward_batch() -> Case:
    """The same states in one call, as a simulated arm takes its steps."""
    robot, motion, expected = _pushed()
    arrays, work = _simulated(robot)
    return Case(
        work="  in one compiled call",
        ours=Contender(
            lambda: _accelerations(arrays, *motion, work), lambda found: relative_error(found, expected)
        ),
        peers={"Pinocchio abaInParallel": lambda: _pinocchio_batch("abaInParallel", robot, motion, expected)},
        tolerance=SAME,
        note="ours by the compiled functions that the simulated arm calls at each of its steps; Pinocchio by "
        "a pool of one model, on one thread",
    )


def regressor(samples: int) -> Case:
    """Regressor of so many states in one call."""
    robot, motion = iiwa(samples)
    expected = _pinocchio_regressors(robot, motion)()
    many = samples > 1
    return Case(
        work=f"regressor, {samples} states" if many else "  a single state",
        ours=Contender(
            lambda: torque_regressor(robot.tree, *motion), lambda found: relative_error(found, expected)
        ),
        peers={
            "Pinocchio, in a Python loop" if many else "Pinocchio": lambda: Contender(
                _pinocchio_regressors(robot, motion), lambda found: relative_error(found, expected)
            )
        },
        tolerance=SAME,
        note="Pinocchio has no batch of regressors" if many else "",
    )


def _pinocchio_regressors(robot: Robot, motion: tuple[np.ndarray, ...]) -> Callable[[], np.ndarray]:
    """(N, n, 10 n), with the inertia's entries in our order; Pinocchio's are xx, xy, yy, xz, yz, zz."""
    import pinocchio

    model, data = robot.model, robot.model.createData()
    found = np.empty((*motion[0].shape, 10 * motion[0].shape[1]))
    order = np.arange(found.shape[2]).reshape(-1, 10)[:, [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]].ravel()

    def run() -> np.ndarray:
        for sample, state in enumerate(zip(*motion, strict=True)):
            found[sample] = pinocchio.computeJointTorqueRegressor(model, data, *state)
        return found[..., order]

    return run


@numba.njit
def _torques(model: InverseDynamics, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (N, n) at positions, velocities and accelerations (N, n)."""
    found = np.empty_like(q)
    for sample in range(len(q)):
        found[sample] = compiled_dynamics.model_torques(model, q[sample], qd[sample], qdd[sample])
    return found


@numba.njit
def _accelerations(
    arrays: RobotArrays, q: np.ndarray, qd: np.ndarray, torques: np.ndarray, work: ChainState
) -> np.ndarray:
    """Accelerations (N, n) at positions, velocities and torques (N, n)."""
    found = torques.copy()
    for sample in range(len(q)):
        compiled_chain.dynamics(arrays, q[sample], qd[sample], work)
        compiled_chain.accelerations(work, found[sample])
    return found


def _simulated(robot: Robot) -> tuple[RobotArrays, ChainState]:
    return robot_arrays(robot.tree, robot.inertias), compiled_chain.workspace(len(robot.tree.names))


def _pushed() -> tuple[Robot, tuple[np.ndarray, ...], np.ndarray]:
    """The robot, positions, velocities and torques (N, n), and the accelerations that they come from."""
    robot, (q, qd, qdd) = iiwa()
    torques = _in_a_loop(_pinocchio(robot, "rnea"), (q, qd, qdd))()
    return robot, (q, qd, torques), qdd


def _contenders(motion: tuple[np.ndarray, ...], expected: np.ndarray) -> Callable[[StateFunction], Contender]:
    """What makes a contender of a function of one state."""
    return lambda function: Contender(
        _in_a_loop(function, motion), lambda found: relative_error(found, expected)
    )


def _in_a_loop(function: StateFunction, motion: tuple[np.ndarray, ...]) -> Callable[[], np.ndarray]:
    def run() -> np.ndarray:
        found = np.empty_like(motion[0])
        for sample, state in enumerate(zip(*motion, strict=True)):
            found[sample] = function(*state)
        return found

    return run


def _pinocchio(robot: Robot, name: str) -> StateFunction:
    import pinocchio

    data, function = robot.model.createData(), getattr(pinocchio, name)
    return lambda *state: function(robot.model, data, *state)


def _pinocchio_batch(
    name: str, robot: Robot, motion: tuple[np.ndarray, ...], expected: np.ndarray
) -> Contender:
    """Needs a build with OpenMP, as the wheels are."""
    import pinocchio

    pool, function = pinocchio.ModelPool(robot.model, 1), getattr(pinocchio, name)
    columns = [np.asfortranarray(values.T) for values in motion]  # a column per state
    return Contender(lambda: function(1, pool, *columns), lambda found: relative_error(found.T, expected))


def _mujoco(given: str, function: str, wanted: str) -> StateFunction:
    """MuJoCo reads the same URDF, without its shapes, and without the damping that it gives the joints.

    `given` and `wanted`: what a state has beside positions and velocities, and what is computed.
    """
    import mujoco

    root = ElementTree.parse(IIWA).getroot()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    model: Any = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    model.dof_damping[:], model.dof_frictionloss[:] = 0.0, 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, compute = mujoco.MjData(model), getattr(mujoco, function)

    position, velocity, third, result = data.qpos, data.qvel, getattr(data, given), getattr(data, wanted)

    def run(q: np.ndarray, qd: np.ndarray, values: np.ndarray) -> np.ndarray:
        position[:], velocity[:], third[:] = q, qd, values  # views of its memory
        compute(model, data)
        return result

    return run


CASES = (
    inverse_one_by_one,
    inverse_of_a_model,
    inverse_batch,
    forward_one_by_one,
    forward_batch,
    lambda: regressor(SAMPLES),
    lambda: regressor(1),
)
