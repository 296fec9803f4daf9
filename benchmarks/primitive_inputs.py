"""What the rows of the movement primitives share with their peers: demonstrations, feedback, errors.

All ways to do the work get the same demonstrations and the same object as coupling term, and their results
are held against the same references, as paths.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.primitives import kernels
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory

SEED = 4
SAMPLES, AXES, DT = 1000, 3, 1e-3  # DT in s

NETWORK = (38, 100, 25, 1)
"""Inputs, hidden layers and output of the learned coupling term (dissertation: 38 sensor traces, PMNN)."""
COUPLING_SCALE = 300.0
"""Enough for the coupling to bend the path by a tenth of its size or so."""


def demonstrations(count: int, lengths: Sequence[int] | None = None) -> list[Trajectory]:
    """Smooth reaches from and to rest around one common reach, with exact derivatives.

    Args:
        count: number of demonstrations.
        lengths: their numbers of samples; default `SAMPLES` each.
    """
    rng = np.random.default_rng(SEED)
    polynomial = np.polynomial.Polynomial
    reach = polynomial([0, 0, 0, 10, -15, 6])  # minimum jerk
    bump = polynomial([0, 0, 0, 1]) * polynomial([1, -1]) ** 3  # at rest at both ends
    common = rng.normal(0.0, 30.0, (AXES, 4))
    paths = []
    for length in lengths or [SAMPLES] * count:
        duration = DT * (length - 1)
        curves = [reach + bump * polynomial(shape + rng.normal(0.0, 10.0, 4)) for shape in common]
        derivatives = [
            np.column_stack([curve.deriv(order)(np.linspace(0.0, 1.0, length)) for curve in curves])
            / duration**order
            for order in range(3)
        ]
        paths.append(Trajectory(DT * np.arange(length), *derivatives))
    return paths


STROKES = (3, 4, 5)


def stroke_demonstrations() -> tuple[list[Trajectory], list[Rhythm]]:
    """Minimum-jerk strokes to and fro, `STROKES` of them in `SAMPLES`, with exact derivatives."""
    stroke = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    paths = []
    for number in STROKES:
        share = number * np.linspace(0.0, 1.0, SAMPLES)
        place = np.minimum(share.astype(int), number - 1)
        rate, back = number / (DT * (SAMPLES - 1)), 1.0 - 2.0 * (place % 2)
        curves = [back * rate**order * stroke.deriv(order)(share - place) for order in range(3)]
        curves[0] += place % 2
        paths.append(
            Trajectory(DT * np.arange(SAMPLES), *(curve[:, None] * [0.02, 0.2, 0.0] for curve in curves))
        )
    return paths, [Rhythm(0.0, number / 2.0) for number in STROKES]


def orientation_demonstration(turn: float) -> OrientationTrajectory:
    """A rotation by `turn` rad about z on top of a swing of a radian or so."""
    swing = demonstrations(1)[0].position * [1.0, 1.0, 0.0]
    clock = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    twist = turn * clock**3 * (10.0 - 15.0 * clock + 6.0 * clock**2) * [0.0, 0.0, 1.0]
    path = quaternion.product(quaternion.from_rotation_vector(swing), quaternion.from_rotation_vector(twist))
    path = quaternion.sign_continuous(path)
    velocity = quaternion.angular_velocity(path, DT)
    return OrientationTrajectory(DT * np.arange(SAMPLES), path, velocity, signals.derivative(velocity, DT))


class CouplingNetwork:
    """Phase-modulated network as feedback in the loop: two tanh layers, the second modulated by the phase.

    The position and velocity stand for six of the sensor traces, which closes the loop.
    """

    def __init__(self, batch: tuple[int, ...], substeps: int = 1) -> None:
        rng = np.random.default_rng(SEED + 1)
        self.weights = [rng.normal(0.0, i**-0.5, (i, o)) for i, o in pairwise(NETWORK)]
        self.biases = [rng.normal(0.0, 0.1, o) for o in NETWORK[1:-1]]
        self.inputs = np.empty((*batch, NETWORK[0]))
        self.inputs[...] = rng.normal(0.0, 0.3, NETWORK[0])
        self.modulation = COUPLING_SCALE * kernels.unit_features(SAMPLES, NETWORK[-2])
        self.substeps = substeps

    def __call__(self, step: int, x: np.ndarray, xd: np.ndarray) -> np.ndarray:
        """Coupling term (..., 1), the same on all axes, at x (..., 3) and xd (..., 3)."""
        self.inputs[..., :3] = x
        self.inputs[..., 3:6] = xd
        hidden = np.tanh(self.inputs @ self.weights[0] + self.biases[0])
        hidden = np.tanh(hidden @ self.weights[1] + self.biases[1])
        return (hidden * self.modulation[step // self.substeps]) @ self.weights[2]


def path_error(path: np.ndarray, reference: np.ndarray) -> float:
    """Largest deviation of positions (..., T, D) relative to the reference's range."""
    reference_range = np.ptp(reference, axis=-2).max()
    return float(np.abs(np.asarray(path)[..., :SAMPLES, :] - reference).max() / reference_range)


def turn_error(path: np.ndarray, reference: np.ndarray) -> float:
    """Largest angle between orientations (T, 4) and those of the reference, in rad."""
    return float(quaternion.angle_between(np.asarray(path)[:SAMPLES], reference).max())
