"""Networks as inverse dynamics of one state, compiled: what a control loop evaluates in every tick.

`multilayer_perceptron` and `lagrangian` are the batched references that are trained; the same passes are
written here for one model and one state.
"""

import math

import numba
import numpy as np

from structlearn.rigid_body.compiled_dynamics import InverseDynamics, add_friction
from structlearn.rigid_body.lagrangian import SMALLEST_INERTIA, StackedLagrangianNetworks
from structlearn.rigid_body.multilayer_perceptron import StackedLayers, StackedPerceptrons

Layers = tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]
"""Weights (previous, next) and biases (next,) of each layer."""


def perceptron(networks: StackedPerceptrons, model: int) -> InverseDynamics:
    """One of M perceptrons as inverse dynamics of one state.

    Args:
        networks: trained.
        model: which, from 0.
    """
    weights, biases = _layers(networks.network, model)
    scaling = (networks.input_mean, networks.input_scale, networks.output_mean, networks.output_scale)
    mean, scale, out_mean, out_scale = (values.double().numpy().ravel() for values in scaling)
    # Standardising is linear and becomes part of the first and the last layer.
    first, last = weights[0] / scale[:, None], weights[-1] * out_scale
    start, end = biases[0] - mean @ first, biases[-1] * out_scale + out_mean
    weights, biases = (first, *weights[1:-1], last), (start, *biases[1:-1], end)
    values = _memory(weights)

    def torques(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        return _perceptron(weights, biases, values, np.concatenate((q, qd, qdd)))

    return torques


def lagrangian(
    networks: StackedLagrangianNetworks, model: int, friction: np.ndarray | None = None
) -> InverseDynamics:
    """One of M deep Lagrangian networks as inverse dynamics of one state.

    Args:
        networks: trained.
        model: which, from 0.
        friction: (3, n) rows of friction (`compiled.friction_rows`) that act beside the network; None: none.
    """
    inertia, potential = _layers(networks.inertia, model), _layers(networks.potential, model)
    memory = (_memory(inertia[0]), _memory(potential[0]))
    places = (networks.row.argmax(dim=1).numpy(), networks.column.argmax(dim=1).numpy())
    rubbing = (
        np.zeros((3, networks.joints)) if friction is None else np.ascontiguousarray(friction, dtype=float)
    )

    def torques(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        return _lagrangian(*inertia, *potential, *memory, *places, rubbing, q, qd, qdd)

    return torques


def _layers(stacked: StackedLayers, model: int) -> Layers:
    pairs = [
        [parameter[model].detach().double().numpy() for parameter in layer] for layer in stacked.layers()
    ]
    # an input's weights side by side: the loops vectorise
    return (
        tuple(np.ascontiguousarray(weights.T) for weights, _ in pairs),
        tuple(bias.ravel().copy() for _, bias in pairs),
    )


def _memory(weights: tuple[np.ndarray, ...]) -> np.ndarray:
    """Room for the values of all layers."""
    return np.zeros((len(weights), max(max(layer.shape) for layer in weights)))


@numba.njit(cache=True, fastmath={"contract"})
def _forward(
    weights: tuple[np.ndarray, ...], biases: tuple[np.ndarray, ...], values: np.ndarray, inputs: np.ndarray
) -> None:
    """Fill `values` with the hidden layers and, in the last row, the outputs."""
    for layer in range(len(weights)):
        matrix, bias, out = weights[layer], biases[layer], values[layer]
        before, after = matrix.shape
        for j in range(after):
            out[j] = bias[j]
        for i in range(before):
            value = inputs[i] if layer == 0 else values[layer - 1, i]
            for j in range(after):
                out[j] += matrix[i, j] * value
        if layer < len(weights) - 1:
            for j in range(after):  # tanh, three times faster than the library's
                out[j] = 1.0 - 2.0 / (math.exp(2.0 * out[j]) + 1.0)


@numba.njit(cache=True)
def _perceptron(
    weights: tuple[np.ndarray, ...], biases: tuple[np.ndarray, ...], values: np.ndarray, inputs: np.ndarray
) -> np.ndarray:
    _forward(weights, biases, values, inputs)
    return values[len(weights) - 1, : len(biases[-1])].copy()


@numba.njit(cache=True, fastmath={"contract"})
def _tangent(weights: tuple[np.ndarray, ...], values: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Change of the outputs along a direction of the inputs."""
    change = direction
    for layer in range(len(weights)):
        matrix = weights[layer]
        before, after = matrix.shape
        out = np.zeros(after)
        for i in range(before):
            for j in range(after):
                out[j] += matrix[i, j] * change[i]
        if layer < len(weights) - 1:
            for j in range(after):
                out[j] *= 1.0 - values[layer, j] * values[layer, j]
        change = out
    return change


@numba.njit(cache=True, fastmath={"contract", "reassoc"})
def _adjoint(weights: tuple[np.ndarray, ...], values: np.ndarray, cotangent: np.ndarray) -> np.ndarray:
    """Gradient at the inputs of the outputs times a cotangent."""
    gradient = cotangent
    for layer in range(len(weights) - 1, -1, -1):
        matrix = weights[layer]
        before, after = matrix.shape
        out = np.empty(before)
        for i in range(before):
            total = 0.0
            for j in range(after):
                total += matrix[i, j] * gradient[j]
            out[i] = total
        if layer > 0:
            for i in range(before):
                out[i] *= 1.0 - values[layer - 1, i] * values[layer - 1, i]
        gradient = out
    return gradient


@numba.njit(cache=True)
def _lagrangian(
    inertia_weights: tuple[np.ndarray, ...],
    inertia_biases: tuple[np.ndarray, ...],
    potential_weights: tuple[np.ndarray, ...],
    potential_biases: tuple[np.ndarray, ...],
    inertia_values: np.ndarray,
    potential_values: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    friction: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
) -> np.ndarray:
    """Torques; the equations are in `lagrangian`'s header."""
    n = len(q)
    _forward(inertia_weights, inertia_biases, inertia_values, q)
    raw = inertia_values[len(inertia_weights) - 1]
    raw_rate = _tangent(inertia_weights, inertia_values, qd)
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
    torques = SMALLEST_INERTIA * qdd
    for i in range(n):
        for j in range(i + 1):
            torques[i] += factor[i, j] * bracket[j] + factor_rate[i, j] * momentum[j]
    cotangent = np.empty(len(rows))
    for k in range(len(rows)):
        cotangent[k] = slope[k] * qd[rows[k]] * momentum[columns[k]]
    _forward(potential_weights, potential_biases, potential_values, q)
    torques -= _adjoint(inertia_weights, inertia_values, cotangent)
    torques += _adjoint(potential_weights, potential_values, np.ones(1))
    add_friction(friction, qd, torques)
    return torques
