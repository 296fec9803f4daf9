"""Gradients of perceptrons and deep Lagrangian networks in closed form, compiled.

The torques are those of `multilayer_perceptron` and `lagrangian`, and the gradients what autograd makes of
them; there most of a step is spent in calls and in memory. A sample is a row. Of layer l with values x, a
Lagrangian network keeps three streams of rows, which are gathered below each other,

    x      its values                     dz     slope of the loss against what goes into its tanh
    e      how a change of torques        c      the adjoint pass, from the outputs' cotangents
           spreads, forwards                     to the inputs
    d      the tangent pass along qd      da     slope against what the tangent pass multiplies with 1 - x^2

so that the gradient of a layer's weights is one product: (dz, c, da)^T of the layer after it times (x, e, d)
of its own. A potential has no tangent pass, a perceptron only values.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numba
import numpy as np

from structlearn.rigid_body.lagrangian import SMALLEST_INERTIA

ROWS = 64
"""Samples that are worked on at once: all that is kept of them stays in the cache."""

X, E, D = range(3)
"""Places of the streams."""


class Network(NamedTuple):
    """Where a network's numbers stand among those of its model.

    Attributes:
        sizes: nodes of each layer, with inputs and outputs.
        before: number of nodes before each layer.
        weights: place of each layer's weights (after, before).
        biases: place of its biases.
        streams: kept of it.
    """

    sizes: np.ndarray
    before: np.ndarray
    weights: np.ndarray
    biases: np.ndarray
    streams: int


class Memory(NamedTuple):
    """What is kept of some rows of samples in each layer of a network.

    Attributes:
        values: x, e and d.
        slopes: dz, c and da.
        spread, adjoint, tangent, change: what e, c, d and da were before they were multiplied with 1 - x^2.
    """

    values: np.ndarray
    slopes: np.ndarray
    spread: np.ndarray
    adjoint: np.ndarray
    tangent: np.ndarray
    change: np.ndarray


class Lower(NamedTuple):
    """What is kept of some rows of samples about L.

    Attributes:
        factor: entries of L.
        slope: of each against what the network gives.
        momentum: L^T qd.
        bracket: L^T qdd + Ldot^T qd.
    """

    factor: np.ndarray
    slope: np.ndarray
    momentum: np.ndarray
    bracket: np.ndarray


class PerceptronGradients:
    """Gradients of M perceptrons whose numbers are weights and biases, as `StackedPerceptrons` has them.

    Args:
        joints: number of joints n.
        hidden: nodes of each hidden layer.
    """

    def __init__(self, joints: int, hidden: Sequence[int]):
        self.network, _ = _network((3 * joints, *hidden, joints), 0, 1)
        self.memory = _memory(self.network)

    def __call__(
        self, numbers: np.ndarray, weights: np.ndarray, inputs: np.ndarray, targets: np.ndarray
    ) -> np.ndarray:
        """Gradients (M, V) of the mean over samples of weighted squared errors.

        Args:
            numbers: (M, V) of the models.
            weights: (n,) of each output's squared error.
            inputs: (B, 3 n) standardised states.
            targets: (B, n) standardised torques.
        """
        return _perceptron_gradients(numbers, self.network, self.memory, weights, inputs, targets)


class LagrangianGradients:
    """Gradients of M deep Lagrangian networks with friction.

    Numbers are those of the network of L, of that of V and of friction, as `StackedLagrangianNetworks` has
    them; the equations are in `lagrangian`'s header.

    Args:
        joints: number of joints n.
        hidden: nodes of each hidden layer.
        entries: row and column of each entry of L.
        squared: (t,) whether a coefficient of friction is the square of its free parameter.
    """

    def __init__(
        self, joints: int, hidden: Sequence[int], entries: tuple[np.ndarray, np.ndarray], squared: np.ndarray
    ):
        count = len(entries[0])
        inertia, end = _network((joints, *hidden, count), 0, 3)
        potential, _ = _network((joints, *hidden, 1), end, 2)
        lower = Lower(*(np.zeros((ROWS, size), np.float32) for size in (count, count, joints, joints)))
        self.networks, self.memory = (inertia, potential), (_memory(inertia), _memory(potential), lower)
        self.entries, self.squared = entries, squared

    def __call__(
        self,
        numbers: np.ndarray,
        weights: np.ndarray,
        states: np.ndarray,
        torques: np.ndarray,
        columns: np.ndarray,
    ) -> np.ndarray:
        """Gradients (M, V) of the mean over samples of weighted squared errors.

        Args:
            numbers: (M, V) of the models.
            weights: (n,) of each joint's squared error.
            states: (B, 3, n) positions, velocities and accelerations.
            torques: (B, n) N m.
            columns: (B, n, t) of friction.
        """
        return _lagrangian_gradients(
            numbers,
            self.networks,
            self.memory,
            self.entries,
            self.squared,
            weights,
            states,
            torques,
            columns,
        )


def _network(sizes: Sequence[int], start: int, streams: int) -> tuple[Network, int]:
    """Places of a network whose numbers begin at `start`, weights first, and where they end."""
    weights = [after * before for before, after in pairwise(sizes)]
    ends = start + np.cumsum([0, *weights, *sizes[1:]])
    layers = len(weights)
    before = np.cumsum([0, *sizes])[:-1]
    return Network(np.array(sizes), before, ends[:layers], ends[layers : 2 * layers], streams), int(ends[-1])


def _memory(of: Network) -> Memory:
    nodes = int(of.sizes.sum()) * ROWS
    return Memory(*(np.zeros(nodes * count, np.float32) for count in (of.streams, of.streams, 1, 1, 1, 1)))


@numba.njit(cache=True)
def _perceptron_gradients(
    numbers: np.ndarray,
    perceptron: Network,
    work: Memory,
    weights: np.ndarray,
    inputs: np.ndarray,
    targets: np.ndarray,
) -> np.ndarray:
    gradients, factors = np.zeros_like(numbers), weights * np.float32(2.0 / len(inputs))
    last = len(perceptron.sizes) - 1
    for begin in range(0, len(inputs), ROWS):
        some, wanted = inputs[begin : begin + ROWS], targets[begin : begin + ROWS]
        rows = len(some)
        for model in range(len(numbers)):
            _stream(work.values, perceptron, X, 0, rows)[:] = some
            _forward(numbers[model], perceptron, work, rows)
            error = _stream(work.values, perceptron, X, last, rows) - wanted
            _stream(work.slopes, perceptron, X, last, rows)[:] = factors * error
            _backward(numbers[model], perceptron, work, rows, gradients[model])
    return gradients


@numba.njit(cache=True)
def _lagrangian_gradients(
    numbers: np.ndarray,
    networks: tuple[Network, Network],
    work: tuple[Memory, Memory, Lower],
    entries: tuple[np.ndarray, np.ndarray],
    squared: np.ndarray,
    weights: np.ndarray,
    states: np.ndarray,
    torques: np.ndarray,
    columns: np.ndarray,
) -> np.ndarray:
    gradients, factors = np.zeros_like(numbers), weights * np.float32(2.0 / len(states))
    for begin in range(0, len(states), ROWS):
        some = slice(begin, begin + ROWS)
        for model in range(len(numbers)):
            _add_lagrangian_gradient(
                numbers[model],
                networks,
                work,
                entries,
                squared,
                factors,
                states[some],
                torques[some],
                columns[some],
                gradients[model],
            )
    return gradients


@numba.njit(cache=True)
def _add_lagrangian_gradient(
    numbers: np.ndarray,
    networks: tuple[Network, Network],
    work: tuple[Memory, Memory, Lower],
    entries: tuple[np.ndarray, np.ndarray],
    squared: np.ndarray,
    factors: np.ndarray,
    states: np.ndarray,
    torques: np.ndarray,
    columns: np.ndarray,
    gradient: np.ndarray,
) -> None:
    """Add the gradient (V,) of one model on at most `ROWS` samples; factors are those of slopes to errors."""
    inertia, potential = networks
    turning, lifting, lower = work
    rows = len(torques)
    last, end = len(inertia.sizes) - 1, len(potential.sizes) - 1
    _stream(turning.values, inertia, X, 0, rows)[:] = states[:, 0]
    _stream(lifting.values, potential, X, 0, rows)[:] = states[:, 0]
    _stream(turning.values, inertia, D, 0, rows)[:] = states[:, 1]
    _forward(numbers, inertia, turning, rows)
    _forward(numbers, potential, lifting, rows)
    _onwards(numbers, inertia, turning, D, turning.tangent, rows)
    raw, rate = _stream(turning.values, inertia, X, last, rows), _plain(turning.tangent, inertia, last, rows)
    error = np.float32(SMALLEST_INERTIA) * states[:, 2] - torques
    _inertial(entries, states, raw, rate, lower, error, _stream(turning.slopes, inertia, E, last, rows))
    _stream(lifting.slopes, potential, E, end, rows)[:] = np.float32(1.0)
    _adjoint(numbers, inertia, turning, rows)
    _adjoint(numbers, potential, lifting, rows)
    error -= _plain(turning.adjoint, inertia, 0, rows)
    error += _plain(lifting.adjoint, potential, 0, rows)
    _rub(numbers, columns, squared, error)

    error *= factors  # from here on its slope
    _add_rubbing(numbers, columns, squared, error, gradient)
    _stream(turning.values, inertia, E, 0, rows)[:] = -error
    _stream(lifting.values, potential, E, 0, rows)[:] = error
    _onwards(numbers, inertia, turning, E, turning.spread, rows)
    _onwards(numbers, potential, lifting, E, lifting.spread, rows)
    _inertial_slopes(
        entries,
        states,
        rate,
        lower,
        error,
        _plain(turning.spread, inertia, last, rows),
        _stream(turning.slopes, inertia, X, last, rows),
        _stream(turning.slopes, inertia, D, last, rows),
    )
    _stream(lifting.slopes, potential, X, end, rows)[:] = np.float32(0.0)
    _backward(numbers, inertia, turning, rows, gradient)
    _backward(numbers, potential, lifting, rows, gradient)


@numba.njit(cache=True)
def _rub(numbers: np.ndarray, columns: np.ndarray, squared: np.ndarray, torques: np.ndarray) -> None:
    """Add friction to torques."""
    rows, joints, terms = columns.shape
    at = len(numbers) - joints * terms
    for row in range(rows):
        for joint in range(joints):
            for term in range(terms):
                free = numbers[at + joint * terms + term]
                torques[row, joint] += columns[row, joint, term] * (free * free if squared[term] else free)


@numba.njit(cache=True)
def _add_rubbing(
    numbers: np.ndarray, columns: np.ndarray, squared: np.ndarray, slopes: np.ndarray, gradient: np.ndarray
) -> None:
    """Add the gradient of friction, from slopes of torques."""
    rows, joints, terms = columns.shape
    at = len(numbers) - joints * terms
    for row in range(rows):
        for joint in range(joints):
            for term in range(terms):
                place = at + joint * terms + term
                change = np.float32(2.0) * numbers[place] if squared[term] else np.float32(1.0)
                gradient[place] += slopes[row, joint] * columns[row, joint, term] * change


@numba.njit(cache=True)
def _stream(of: np.ndarray, its: Network, stream: int, layer: int, rows: int) -> np.ndarray:
    """(rows, nodes) of a stream in a layer, of values or slopes."""
    size = its.sizes[layer]
    begin = rows * (its.streams * its.before[layer] + stream * size)
    return of[begin : begin + rows * size].reshape(rows, size)


@numba.njit(cache=True)
def _streams(of: np.ndarray, its: Network, layer: int, rows: int) -> np.ndarray:
    """(streams rows, nodes) of all streams in a layer."""
    size, below = its.sizes[layer], its.streams * rows
    begin = below * its.before[layer]
    return of[begin : begin + below * size].reshape(below, size)


@numba.njit(cache=True)
def _plain(of: np.ndarray, its: Network, layer: int, rows: int) -> np.ndarray:
    """(rows, nodes) of a layer, of what is not multiplied with 1 - x^2."""
    size = its.sizes[layer]
    begin = rows * its.before[layer]
    return of[begin : begin + rows * size].reshape(rows, size)


@numba.njit(cache=True)
def _matrix(values: np.ndarray, its: Network, layer: int) -> np.ndarray:
    """Weights (after, before) of a layer."""
    before, after = its.sizes[layer], its.sizes[layer + 1]
    begin = its.weights[layer]
    return values[begin : begin + after * before].reshape(after, before)


@numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _tanh(x: np.float32) -> np.float32:
    """A quotient of polynomials as in Eigen, to the last digits of single precision; it becomes vectors."""
    x = min(max(x, np.float32(-7.90531110763549805)), np.float32(7.90531110763549805))
    y = x * x
    over = np.float32(-2.76076847742355e-16)
    over = over * y + np.float32(2.00018790482477e-13)
    over = over * y + np.float32(-8.60467152213735e-11)
    over = over * y + np.float32(5.12229709037114e-08)
    over = over * y + np.float32(1.48572235717979e-05)
    over = over * y + np.float32(6.37261928875436e-04)
    over = over * y + np.float32(4.89352455891786e-03)
    under = np.float32(1.19825839466702e-06)
    under = under * y + np.float32(1.18534705686654e-04)
    under = under * y + np.float32(2.26843463243900e-03)
    under = under * y + np.float32(4.89352518554385e-03)
    return x * over / under


@numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _forward(numbers: np.ndarray, its: Network, work: Memory, rows: int) -> None:
    """Values of all layers from those of the first."""
    last = len(its.sizes) - 2
    for layer in range(last + 1):
        out = _stream(work.values, its, X, layer + 1, rows)
        np.dot(_stream(work.values, its, X, layer, rows), _matrix(numbers, its, layer).T, out)
        size = its.sizes[layer + 1]
        biases = numbers[its.biases[layer] : its.biases[layer] + size]
        for row in range(rows):
            values = out[row]
            for node in range(size):
                values[node] += biases[node]
        if layer < last:
            flat = out.reshape(-1)
            for place in range(len(flat)):
                flat[place] = _tanh(flat[place])


@numba.njit(cache=True)
def _onwards(
    numbers: np.ndarray, its: Network, work: Memory, stream: int, plain: np.ndarray, rows: int
) -> None:
    """Carry a change of the inputs through all layers."""
    last = len(its.sizes) - 2
    for layer in range(last + 1):
        found = _plain(plain, its, layer + 1, rows)
        np.dot(_stream(work.values, its, stream, layer, rows), _matrix(numbers, its, layer).T, found)
        if layer < last:
            values = _stream(work.values, its, X, layer + 1, rows)
            _damp(values, found, _stream(work.values, its, stream, layer + 1, rows))


@numba.njit(cache=True)
def _adjoint(numbers: np.ndarray, its: Network, work: Memory, rows: int) -> None:
    """Carry cotangents of the outputs back to the inputs."""
    for layer in range(len(its.sizes) - 2, -1, -1):
        found = _plain(work.adjoint, its, layer, rows)
        np.dot(_stream(work.slopes, its, E, layer + 1, rows), _matrix(numbers, its, layer), found)
        if layer > 0:
            values = _stream(work.values, its, X, layer, rows)
            _damp(values, found, _stream(work.slopes, its, E, layer, rows))


@numba.njit(cache=True)
def _backward(numbers: np.ndarray, its: Network, work: Memory, rows: int, gradient: np.ndarray) -> None:
    """Add the gradient of all numbers, from the slopes of the last layer."""
    for layer in range(len(its.sizes) - 2, -1, -1):
        product = np.dot(
            _streams(work.slopes, its, layer + 1, rows).T, _streams(work.values, its, layer, rows)
        )
        found = _matrix(gradient, its, layer)
        found += product
        slopes = _stream(work.slopes, its, X, layer + 1, rows)
        begin = its.biases[layer]
        for row in range(rows):
            for node in range(its.sizes[layer + 1]):
                gradient[begin + node] += slopes[row, node]
        if layer == 0:
            return
        before = _stream(work.slopes, its, X, layer, rows)
        np.dot(slopes, _matrix(numbers, its, layer), before)
        values = _stream(work.values, its, X, layer, rows)
        if its.streams > E:
            spread, adjoint = _plain(work.spread, its, layer, rows), _plain(work.adjoint, its, layer, rows)
            _curve(values, spread, adjoint, before)
        if its.streams > D:
            change = _plain(work.change, its, layer, rows)
            np.dot(_stream(work.slopes, its, D, layer + 1, rows), _matrix(numbers, its, layer), change)
            _curve(values, _plain(work.tangent, its, layer, rows), change, before)
            _damp(values, change, _stream(work.slopes, its, D, layer, rows))
        _damp(values, before, before)


@numba.njit(cache=True, fastmath={"contract"})
def _damp(values: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
    """Multiply with the slope 1 - x^2 of a layer's tanh."""
    x, given, found = values.reshape(-1), before.reshape(-1), after.reshape(-1)
    for place in range(len(x)):
        found[place] = (np.float32(1.0) - x[place] * x[place]) * given[place]


@numba.njit(cache=True, fastmath={"contract"})
def _curve(values: np.ndarray, first: np.ndarray, second: np.ndarray, slopes: np.ndarray) -> None:
    """Add to the slopes of a layer's values what comes from the change of 1 - x^2."""
    x, a, b, found = values.reshape(-1), first.reshape(-1), second.reshape(-1), slopes.reshape(-1)
    for place in range(len(x)):
        found[place] -= np.float32(2.0) * x[place] * a[place] * b[place]


@numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _inertial(
    entries: tuple[np.ndarray, np.ndarray],
    states: np.ndarray,
    raw: np.ndarray,
    rate: np.ndarray,
    lower: Lower,
    torques: np.ndarray,
    cotangents: np.ndarray,
) -> None:
    """Fill L, add L Ldot^T qd + Ldot L^T qd + L L^T qdd to torques, find cotangents of the network of L."""
    rows, columns = entries
    lower.momentum[:] = np.float32(0.0)
    lower.bracket[:] = np.float32(0.0)
    for sample in range(len(raw)):
        qd, qdd = states[sample, 1], states[sample, 2]
        factor, slope = lower.factor[sample], lower.slope[sample]
        momentum, bracket = lower.momentum[sample], lower.bracket[sample]
        for k in range(len(rows)):
            row, column, value = rows[k], columns[k], raw[sample, k]
            factor[k], slope[k] = value, np.float32(1.0)
            if row == column:
                slope[k] = np.float32(1.0) / (np.float32(1.0) + math.exp(-value))
                factor[k] = max(value, np.float32(0.0)) + math.log1p(math.exp(-abs(value)))  # softplus
            momentum[column] += factor[k] * qd[row]
            bracket[column] += factor[k] * qdd[row] + slope[k] * rate[sample, k] * qd[row]
        for k in range(len(rows)):
            row, column = rows[k], columns[k]
            factor_rate = slope[k] * rate[sample, k]
            torques[sample, row] += factor[k] * bracket[column] + factor_rate * momentum[column]
            cotangents[sample, k] = slope[k] * qd[row] * momentum[column]


@numba.njit(cache=True, fastmath={"contract"})
def _inertial_slopes(
    entries: tuple[np.ndarray, np.ndarray],
    states: np.ndarray,
    rate: np.ndarray,
    lower: Lower,
    torques: np.ndarray,
    cotangents: np.ndarray,
    raw_slopes: np.ndarray,
    rate_slopes: np.ndarray,
) -> None:
    """From slopes of torques and cotangents back to those of the network of L."""
    rows, columns = entries
    joints = torques.shape[1]
    momentum_slope, bracket_slope = np.empty(joints, np.float32), np.empty(joints, np.float32)
    for sample in range(len(rate)):
        qd, qdd = states[sample, 1], states[sample, 2]
        factor, slope = lower.factor[sample], lower.slope[sample]
        momentum, bracket = lower.momentum[sample], lower.bracket[sample]
        momentum_slope[:] = np.float32(0.0)
        bracket_slope[:] = np.float32(0.0)
        for k in range(len(rows)):
            row, column = rows[k], columns[k]
            given = torques[sample, row]
            bracket_slope[column] += given * factor[k]
            momentum_slope[column] += slope[k] * (given * rate[sample, k] + cotangents[sample, k] * qd[row])
        for k in range(len(rows)):
            row, column = rows[k], columns[k]
            given = torques[sample, row]
            of_factor = (
                given * bracket[column] + bracket_slope[column] * qdd[row] + momentum_slope[column] * qd[row]
            )
            of_rate = given * momentum[column] + bracket_slope[column] * qd[row]
            of_slope = cotangents[sample, k] * qd[row] * momentum[column] + rate[sample, k] * of_rate
            rate_slopes[sample, k] = slope[k] * of_rate
            raw_slopes[sample, k] = slope[k] * (of_factor + of_slope * (np.float32(1.0) - slope[k]))
