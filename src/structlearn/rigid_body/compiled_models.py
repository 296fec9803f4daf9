"""Inverse dynamics of one state by any kind of model, compiled: what a control loop evaluates in every tick.

Known or learned bodies, a perceptron or a Lagrangian network: one compiled loop takes them all. The batched
references that are trained are in `network_models`; `dynamics_models.compiled_model` packs them.
"""

import math
from typing import NamedTuple

import numba
import numpy as np

from structlearn.networks.compiled_layers import affine, hidden_layers
from structlearn.rigid_body.compiled_dynamics import RigidBodies, add_friction, newton_euler


class Networks(NamedTuple):
    """A perceptron, or the two networks of a Lagrangian one, as compiled functions take them.

    Attributes:
        values: all numbers, as in `compiled_layers.PackedNetworks`.
        first: (P,) where each network begins in `values`.
        sizes: (P, L + 1) inputs, then width of each layer.
        memory: (P, L + 2, W) for the layers' values.
        rows: (n (n + 1) / 2,) where outputs of a Lagrangian's first network stand in the inertia's factor.
        columns: likewise; both are empty of a perceptron.
        least_inertia: of a Lagrangian, added to the diagonal of its inertia.
        friction: (3, n) of `compiled_dynamics.friction_rows`, beside a Lagrangian.
    """

    values: np.ndarray
    first: np.ndarray
    sizes: np.ndarray
    memory: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    least_inertia: float
    friction: np.ndarray


@numba.njit(cache=True)
def perceptron_torques(networks: Networks, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a perceptron."""
    inputs = np.concatenate((q, qd, qdd))
    return _forward(networks.values, 0, networks.sizes[0], inputs, networks.memory[0]).copy()


@numba.njit(cache=True)
def lagrangian_torques(networks: Networks, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a Lagrangian network; the equations are in `lagrangian`'s header."""
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
    add_friction(networks.friction, qd, torques)
    return torques


@numba.njit(cache=True, fastmath={"contract"})
def _forward(
    values: np.ndarray, begin: int, sizes: np.ndarray, inputs: np.ndarray, work: np.ndarray
) -> np.ndarray:
    """Outputs of a network whose last layer is linear; its layers' values stay in rows of work."""
    last = len(sizes) - 2
    at = hidden_layers(values, begin, last, sizes, inputs, work)
    affine(values, at, sizes[last], sizes[last + 1], work[last], work[last + 1])
    return work[last + 1, : sizes[last + 1]]


@numba.njit(cache=True, fastmath={"contract"})
def _tangent(
    values: np.ndarray, begin: int, sizes: np.ndarray, work: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Change of the outputs along a direction of the inputs."""
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
    """Gradient at the inputs of the outputs times a cotangent; the network's numbers stand before `end`."""
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
    """A model of whatever kind, as arrays.

    Attributes:
        kind: `BODIES`, `PERCEPTRON` or `LAGRANGIAN`.
        bodies: of the first kind; without joints of the others.
        networks: of the others; without numbers of the first kind.
    """

    kind: int
    bodies: RigidBodies
    networks: Networks

    def __call__(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Torques (n,) in N m at position, velocity and acceleration of the joints, (n,) each."""
        return model_torques(self, q, qd, qdd)


def bodies_model(bodies: RigidBodies) -> InverseDynamics:
    """Rigid bodies among all kinds of models."""
    places = np.empty(0, dtype=np.int64)
    empty = (np.empty(0), places, np.empty((0, 0), dtype=np.int64), np.empty((0, 0, 0)))
    return InverseDynamics(BODIES, bodies, Networks(*empty, places, places, 0.0, np.empty((3, 0))))


def networks_model(kind: int, networks: Networks) -> InverseDynamics:
    """Networks among all kinds of models."""
    frames, vectors = np.empty((0, 3, 3)), np.empty((0, 3))
    chain = (np.empty(0, dtype=np.int64), frames, vectors, vectors, np.empty(0, dtype=bool))
    nothing = RigidBodies(*chain, np.zeros(3), np.empty(0), vectors, frames, np.empty((3, 0)))
    return InverseDynamics(kind, nothing, networks)


@numba.njit(cache=True)
def model_torques(model: InverseDynamics, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (n,) in N m of a model of any kind."""
    if model.kind == PERCEPTRON:
        return perceptron_torques(model.networks, q, qd, qdd)
    if model.kind == LAGRANGIAN:
        return lagrangian_torques(model.networks, q, qd, qdd)
    return newton_euler(model.bodies, q, qd, qdd)
