"""Inverse and forward dynamics of states of the iiwa: a call from Python for each, or one compiled for all.

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
        ours=contender(compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)),
        peers={
            "Pinocchio rnea": lambda: contender(_pinocchio(robot, "rnea")),
            "MuJoCo mj_inverse": lambda: contender(_mujoco("qacc", "mj_inverse", "qfrc_inverse")),
        },
        tolerance=MUJOCO,
        note="a call from Python for each state: numba unpacks the model's arrays each time, which compiled "
        "callers (simulators, the controller) do not pay for",
    )


def forward_one_by_one() -> Case:
    """Accelerations likewise, as a simulator in Python asks for them."""
    robot, motion, expected = _pushed()
    contender = _contenders(motion, expected)
    arrays, work = _simulated(robot)

    def ours(q: np.ndarray, qd: np.ndarray, torques: np.ndarray) -> np.ndarray:
        found = torques.copy()
        compiled_chain.dynamics(arrays, q, qd, work)
        compiled_chain.accelerations(work, found)
        return found

    return Case(
        work=f"forward dynamics, {SAMPLES} states one by one",
        ours=contender(ours),
        peers={
            "Pinocchio aba": lambda: contender(_pinocchio(robot, "aba")),
            "MuJoCo mj_forward": lambda: contender(_mujoco("qfrc_applied", "mj_forward", "qacc")),
        },
        tolerance=MUJOCO,
        note="two calls from Python for each state, with the arrays of model and workspace, which numba "
        "unpacks each time; to Python, Pinocchio's and MuJoCo's models are one object",
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
        peers={"Pinocchio abaInParallel": lambda: _pinocchio_batch(robot, motion, expected)},
        tolerance=SAME,
        note="ours by the compiled functions that the simulated arm calls at each of its steps; Pinocchio by "
        "a pool of one model, on one thread",
    )


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


def _pinocchio_batch(robot: Robot, motion: tuple[np.ndarray, ...], expected: np.ndarray) -> Contender:
    """Needs a build with OpenMP, as the wheels are."""
    from pinocchio import ModelPool, abaInParallel  # a column per state

    pool, columns = ModelPool(robot.model, 1), [np.asfortranarray(values.T) for values in motion]
    return Contender(
        lambda: abaInParallel(1, pool, *columns), lambda found: relative_error(found.T, expected)
    )


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

    def run(q: np.ndarray, qd: np.ndarray, third: np.ndarray) -> np.ndarray:
        data.qpos, data.qvel = q, qd
        setattr(data, given, third)
        compute(model, data)
        return getattr(data, wanted)

    return run


CASES = (inverse_one_by_one, forward_one_by_one, forward_batch)
