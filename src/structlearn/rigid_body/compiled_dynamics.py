"""Compiled inverse dynamics of a single state, for control loops.

Rigid-body models, perceptrons and Lagrangian networks share one type, so one compiled loop takes all three.
Inertias are about the joint origins, where the recursion needs only the first moment h = m c.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, get_args

import numpy as np

from structlearn.core.compilation import cross, numba
from structlearn.core.packed_arrays import packed, unpacking
from structlearn.networks.compiled_layers import affine, hidden_layers
from structlearn.rigid_body.friction import COULOMB_WIDTH, FrictionTerm
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, RobotArrays, robot_arrays


def inverse_dynamics(
    tree: KinematicTree, inertias: LinkInertias, friction: np.ndarray | None = None
) -> "InverseDynamics":
    """Newton-Euler inverse dynamics of a single state (eq. III.1); the inertias need not be physical.

    Friction is (4, n) as from `friction_rows`, or None.

    Raises ValueError: friction has another shape, so that compiled functions would read out of bounds.
    """
    expected = (len(get_args(FrictionTerm)), len(tree.names))
    rows = np.zeros(expected) if friction is None else np.array(friction, dtype=float)
    if rows.shape != expected:
        raise ValueError(f"friction has the shape {rows.shape}, not {expected}")
    return InverseDynamics(BODIES, robot_arrays(tree, inertias), NO_NETWORKS, rows)


def friction_rows(coefficients: np.ndarray, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """Friction (4, n) for compiled functions, from coefficients (n, k) of the given terms.

    Rows: viscous in N m s/rad, Coulomb and offset in N m, stiffness in N m/rad; absent terms are zero.
    """
    rows = np.zeros((len(get_args(FrictionTerm)), len(coefficients)))
    for column, term in enumerate(terms):
        rows[get_args(FrictionTerm).index(term)] = coefficients[:, column]
    return rows


@numba.njit(cache=True, inline="always")
def joint_placement(robot: RobotArrays, joint: int, q: float, turn: np.ndarray, offset: np.ndarray) -> None:
    """Write rotation `turn` (3, 3) and origin `offset` (3,) of a joint frame in its parent's frame."""
    rotation, translation, axis = robot.rotation[joint], robot.translation[joint], robot.axis[joint]
    if robot.prismatic[joint]:
        for row in range(3):
            shift = 0.0
            for k in range(3):
                turn[row, k] = rotation[row, k]
                shift += rotation[row, k] * axis[k]
            offset[row] = translation[row] + q * shift
        return
    c, s = math.cos(q), math.sin(q)
    x, y, z = axis[0], axis[1], axis[2]
    d = 1.0 - c  # Rodrigues
    own = (
        (c + x * x * d, x * y * d - z * s, x * z * d + y * s),
        (y * x * d + z * s, c + y * y * d, y * z * d - x * s),
        (z * x * d - y * s, z * y * d + x * s, c + z * z * d),
    )
    for row in range(3):
        offset[row] = translation[row]
        for k in range(3):
            turn[row, k] = (
                rotation[row, 0] * own[0][k] + rotation[row, 1] * own[1][k] + rotation[row, 2] * own[2][k]
            )


@numba.njit(cache=True, inline="always")
def _turned_back(turn: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    """R^T v: a vector of the parent's frame, in the joint frame."""
    for k in range(3):
        out[k] = turn[0, k] * vector[0] + turn[1, k] * vector[1] + turn[2, k] * vector[2]


@numba.njit(cache=True)
def newton_euler(robot: RobotArrays, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m by the recursive Newton-Euler algorithm."""
    parents, prismatic, axis = robot.parents, robot.prismatic, robot.axis
    mass, first_moment, inertia = robot.mass, robot.first_moment, robot.origin_inertia
    count = len(q)
    turn, offset = np.empty((count, 3, 3)), np.empty((count, 3))
    # angular velocity and acceleration of each link, linear acceleration of its origin
    omega, omega_rate, acceleration = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    force, torque = np.empty((count, 3)), np.empty((count, 3))
    carried = np.empty(3)
    for i in range(count):
        joint_placement(robot, i, q[i], turn[i], offset[i])
        w, dw, a = omega[i], omega_rate[i], acceleration[i]
        parent = parents[i]
        if parent < 0:
            w[:] = 0.0
            dw[:] = 0.0
            _turned_back(turn[i], robot.gravity, a)
            for k in range(3):
                a[k] = -a[k]
        else:
            parent_w, parent_dw, parent_a = omega[parent], omega_rate[parent], acceleration[parent]
            velocity, tangential = cross(parent_w, offset[i]), cross(parent_dw, offset[i])
            centripetal = cross(parent_w, velocity)
            for k in range(3):
                carried[k] = parent_a[k] + tangential[k] + centripetal[k]
            _turned_back(turn[i], carried, a)
            _turned_back(turn[i], parent_w, w)
            _turned_back(turn[i], parent_dw, dw)
        coriolis = cross(w, axis[i])
        for k in range(3):
            if prismatic[i]:
                a[k] += 2.0 * coriolis[k] * qd[i] + axis[i, k] * qdd[i]
            else:
                dw[k] += coriolis[k] * qd[i] + axis[i, k] * qdd[i]
        if not prismatic[i]:
            for k in range(3):
                w[k] += axis[i, k] * qd[i]
        h = first_moment[i]
        w_h, dw_h, h_a = cross(w, h), cross(dw, h), cross(h, a)
        momentum = (
            inertia[i, 0, 0] * w[0] + inertia[i, 0, 1] * w[1] + inertia[i, 0, 2] * w[2],
            inertia[i, 1, 0] * w[0] + inertia[i, 1, 1] * w[1] + inertia[i, 1, 2] * w[2],
            inertia[i, 2, 0] * w[0] + inertia[i, 2, 1] * w[1] + inertia[i, 2, 2] * w[2],
        )
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            force[i, k] = mass[i] * a[k] + dw_h[k] + w[m] * w_h[n] - w[n] * w_h[m]
            torque[i, k] = h_a[k] + w[m] * momentum[n] - w[n] * momentum[m]
            for j in range(3):
                torque[i, k] += inertia[i, k, j] * dw[j]
    torques = np.empty(count)
    for i in range(count - 1, -1, -1):
        along = force[i] if prismatic[i] else torque[i]
        torques[i] = axis[i, 0] * along[0] + axis[i, 1] * along[1] + axis[i, 2] * along[2]
        parent = parents[i]
        if parent >= 0:
            for k in range(3):
                carried[k] = (
                    turn[i, k, 0] * force[i, 0] + turn[i, k, 1] * force[i, 1] + turn[i, k, 2] * force[i, 2]
                )
                force[parent, k] += carried[k]
                torque[parent, k] += (
                    turn[i, k, 0] * torque[i, 0] + turn[i, k, 1] * torque[i, 1] + turn[i, k, 2] * torque[i, 2]
                )
            lever = cross(offset[i], carried)
            for k in range(3):
                torque[parent, k] += lever[k]
    return torques


@numba.njit(cache=True)
def add_friction(friction: np.ndarray, q: np.ndarray, qd: np.ndarray, torques: np.ndarray) -> None:
    """Add friction, rows (4, n) as `friction_rows`, at positions and velocities (n,) to torques (n,)."""
    for i in range(len(qd)):
        direction = math.tanh(qd[i] / COULOMB_WIDTH) if friction[1, i] != 0.0 else 0.0
        torques[i] += friction[0, i] * qd[i] + friction[1, i] * direction + friction[2, i]
        torques[i] += friction[3, i] * q[i]


class Networks(NamedTuple):
    """A perceptron, or the two networks of a Lagrangian model, for compiled functions."""

    values: np.ndarray  # all weights and biases, as in `compiled_layers.PackedNetworks`
    first: np.ndarray  # (P,) where each network begins in `values`
    sizes: np.ndarray  # (P, L + 1) inputs, then width of each layer
    memory: np.ndarray  # (P, L + 2, W) scratch for activations
    # (n (n + 1) / 2,) row and column of each output of a Lagrangian's first network in L; else empty
    rows: np.ndarray
    columns: np.ndarray
    least_inertia: float  # added to the diagonal of a Lagrangian's inertia matrix


@numba.njit(cache=True)
def perceptron_torques(networks: Networks, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a perceptron."""
    inputs = np.concatenate((q, qd, qdd))
    return _forward(networks.values, 0, networks.sizes[0], inputs, networks.memory[0]).copy()


@numba.njit(cache=True)
def lagrangian_torques(networks: Networks, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a Lagrangian network; see the equations in `network_models`."""
    values, first, sizes = networks.values, networks.first, networks.sizes
    inertia_work, potential_work = networks.memory[0], networks.memory[1]
    rows, columns = networks.rows, networks.columns
    n = len(q)
    raw = _forward(values, first[0], sizes[0], q, inertia_work)
    raw_rate = _tangent(values, first[0], sizes[0], inertia_work, qd)
    factor, factor_rate, slope = np.zeros((n, n)), np.zeros((n, n)), np.ones(len(rows))
    for k in range(len(rows)):
        row, column = rows[k], columns[k]
        value = raw[k]
        if row == column:
            slope[k] = 1.0 / (1.0 + math.exp(-value))
            value = max(value, 0.0) + math.log1p(math.exp(-abs(value)))  # softplus
        factor[row, column] = value
        factor_rate[row, column] = slope[k] * raw_rate[k]
    momentum, bracket = np.zeros(n), np.zeros(n)
    for i in range(n):
        for j in range(i + 1):
            momentum[j] += factor[i, j] * qd[i]
            bracket[j] += factor[i, j] * qdd[i] + factor_rate[i, j] * qd[i]
    torques = networks.least_inertia * qdd
    for i in range(n):
        for j in range(i + 1):
            torques[i] += factor[i, j] * bracket[j] + factor_rate[i, j] * momentum[j]
    cotangent = np.empty(len(rows))
    for k in range(len(rows)):
        cotangent[k] = slope[k] * qd[rows[k]] * momentum[columns[k]]
    _forward(values, first[1], sizes[1], q, potential_work)
    torques -= _adjoint(values, first[1], sizes[0], inertia_work, cotangent)
    torques += _adjoint(values, len(values), sizes[1], potential_work, np.ones(1))
    return torques


@numba.njit(cache=True, fastmath={"contract"})
def _forward(
    values: np.ndarray, begin: int, sizes: np.ndarray, inputs: np.ndarray, work: np.ndarray
) -> np.ndarray:
    """Outputs of a network with a linear last layer; activations are left in `work`."""
    last = len(sizes) - 2
    at = hidden_layers(values, begin, last, sizes, inputs, work)
    affine(values, at, sizes[last], sizes[last + 1], work[last], work[last + 1])
    return work[last + 1, : sizes[last + 1]]


@numba.njit(cache=True, fastmath={"contract"})
def _tangent(
    values: np.ndarray, begin: int, sizes: np.ndarray, work: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Directional derivative of the outputs along a direction of the inputs."""
    change, at, last = direction, begin + 2 * sizes[0], len(sizes) - 2
    for layer in range(last + 1):
        before, after = sizes[layer], sizes[layer + 1]
        matrix = values[at : at + before * after].reshape(before, after)
        out = np.zeros(after)
        for i in range(before):
            for j in range(after):
                out[j] += matrix[i, j] * change[i]
        if layer < last:
            for j in range(after):
                out[j] *= 1.0 - work[layer + 1, j] * work[layer + 1, j]
        change, at = out, at + (before + 1) * after
    return change


@numba.njit(cache=True, fastmath={"contract", "reassoc"})
def _adjoint(
    values: np.ndarray, end: int, sizes: np.ndarray, work: np.ndarray, cotangent: np.ndarray
) -> np.ndarray:
    """Vector-Jacobian product: gradient of cotangent . outputs by the inputs; weights end at `end`."""
    gradient, at = cotangent, end
    for layer in range(len(sizes) - 2, -1, -1):
        before, after = sizes[layer], sizes[layer + 1]
        at -= (before + 1) * after
        matrix = values[at : at + before * after].reshape(before, after)
        out = np.empty(before)
        for i in range(before):
            total = 0.0
            for j in range(after):
                total += matrix[i, j] * gradient[j]
            out[i] = total
        if layer > 0:
            for i in range(before):
                out[i] *= 1.0 - work[layer, i] * work[layer, i]
        gradient = out
    return gradient


BODIES, PERCEPTRON, LAGRANGIAN = range(3)


class InverseDynamics(NamedTuple):
    """Inverse dynamics of a model of any kind, as arrays."""

    kind: int  # `BODIES`, `PERCEPTRON` or `LAGRANGIAN`
    robot: RobotArrays  # empty for networks
    networks: Networks  # empty for rigid bodies
    friction: np.ndarray  # (4, n) as `friction_rows`

    def __call__(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Torques (n,) in N m at q, qd, qdd (n,) in rad, rad/s, rad/s^2 (m where a joint slides)."""
        return model_torques(self, q, qd, qdd)


_PLACES = np.empty(0, np.int64)
_VECTORS, _FRAMES = np.empty((0, 3)), np.empty((0, 3, 3))
NO_ROBOT = RobotArrays(
    _PLACES, _FRAMES, _VECTORS, _VECTORS, np.empty(0, bool), np.zeros(3),
    np.empty(0), _VECTORS, _FRAMES, _VECTORS, _FRAMES,
)  # fmt: skip
NO_NETWORKS = Networks(
    np.empty(0), _PLACES, _PLACES.reshape(0, 0), np.empty((0, 0, 0)), _PLACES, _PLACES, 0.0
)


@numba.njit(cache=True)
def model_torques(model: InverseDynamics, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a model of any kind."""
    if model.kind == PERCEPTRON:
        torques = perceptron_torques(model.networks, q, qd, qdd)
    elif model.kind == LAGRANGIAN:
        torques = lagrangian_torques(model.networks, q, qd, qdd)
    else:
        torques = newton_euler(model.robot, q, qd, qdd)
    add_friction(model.friction, q, qd, torques)
    return torques


_NOTHING = InverseDynamics(BODIES, NO_ROBOT, NO_NETWORKS, np.empty((0, 0)))
_model_of = unpacking(_NOTHING)


def from_python(model: InverseDynamics) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """The model as a function of one state for loops in Python, faster than the model's own call.

    Its arrays are handed over once (`core.packed_arrays`). Networks have one scratch memory: one thread only.
    """
    table = packed(model, _NOTHING)

    def torques(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, model: InverseDynamics = model) -> np.ndarray:
        return _packed_torques(table, q, qd, qdd)  # the default keeps the arrays

    return torques


@numba.njit(cache=True)
def _packed_torques(table: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    return model_torques(_model_of(table), q, qd, qdd)
