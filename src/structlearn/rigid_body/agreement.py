"""Our inverse dynamics beside Pinocchio's, for the same parameters at random states."""

import numpy as np
import pinocchio
import torch

from structlearn.rigid_body import compiled_dynamics, newton_euler
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.tree import LinkInertias, Robot

_LARGEST = (2.0, 2.0, 5.0)
"""rad, rad/s and rad/s^2: positions are drawn evenly up to it, the others normally with it as std."""


def agreement_with_pinocchio(robot: Robot, states: int = 200, seed: int = 0) -> dict[str, float]:
    """Largest differences of torques over joints and states.

    Args:
        robot: n joints.
        states: number of random states.
        seed: of the states.

    Returns:
        `largest_n_m`, the largest torque of Pinocchio's recursive Newton-Euler (`rnea`); largest difference
        from it in N m of ours: `recursion_n_m` (batched), `regressor_n_m`, `compiled_n_m` (one state, for
        control).
    """
    (q, qd, qdd), expected = _pinocchio_torques(robot, states, seed)
    rows = list(zip(q, qd, qdd, strict=True))
    inertias, tensors = robot.inertias.tensors(), (torch.from_numpy(values) for values in (q, qd, qdd))
    one = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    found = {
        "recursion_n_m": newton_euler.inverse_dynamics(robot.tree, inertias, *tensors).numpy(),
        "regressor_n_m": torque_regressor(robot.tree, q, qd, qdd) @ link_parameters(inertias).numpy(),
        "compiled_n_m": np.array([one(*row) for row in rows]),
    }
    errors = {name: float(np.abs(torques - expected).max()) for name, torques in found.items()}
    return {"largest_n_m": float(np.abs(expected).max())} | errors


def torque_differences(
    robot: Robot, inertias: LinkInertias[np.ndarray], states: int = 200, seed: int = 0
) -> np.ndarray:
    """Largest difference (n,) in N m between Pinocchio's torques of a robot and ours of some inertias.

    Args:
        robot: whose inertias Pinocchio takes.
        inertias: (n,) of its links, that ours are of.
        states: number of random states.
        seed: of the states.
    """
    (q, qd, qdd), expected = _pinocchio_torques(robot, states, seed)
    ours = torque_regressor(robot.tree, q, qd, qdd) @ link_parameters(inertias.tensors()).numpy()
    return np.abs(ours - expected).max(axis=0)


def _pinocchio_torques(
    robot: Robot, states: int, seed: int
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """Random positions, velocities and accelerations, and the torques (states, n) of Pinocchio's `rnea`."""
    generator = np.random.default_rng(seed)
    shape = (states, len(robot.tree.names))
    q = generator.uniform(-_LARGEST[0], _LARGEST[0], shape)
    qd, qdd = (generator.normal(0.0, spread, shape) for spread in _LARGEST[1:])
    data, rows = robot.model.createData(), zip(q, qd, qdd, strict=True)
    expected = [
        pinocchio.rnea(robot.model, data, _configuration(robot.model, row), *rest) for row, *rest in rows
    ]
    return (q, qd, qdd), np.array(expected)


def _configuration(model: pinocchio.Model, q: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration: the position of an endless joint is a cosine and a sine there."""
    parts = []
    for joint, position in zip(list(model.joints)[1:], q, strict=True):
        parts += [np.cos(position), np.sin(position)] if joint.nq == 2 else [position]
    return np.array(parts)
