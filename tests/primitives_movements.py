"""Movements with exact derivatives that the tests of the primitives share."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from structlearn.core import quaternion
from structlearn.primitives import canonical
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory
from structlearn.primitives.twist_swing import fit_twist_swing

quick = settings(max_examples=8, deadline=None, derandomize=True)
few = settings(quick, max_examples=4)  # for examples that take 50 ms each

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def for_rngs(test):
    """Decorator: the test's argument `rng` is a random generator, anew for each example."""
    return quick(given(rng=rngs)(test))


def for_few_rngs(test):
    """The same with few examples."""
    return few(given(rng=rngs)(test))


def random_orientations(rng, *shape):
    return quaternion.normalised(rng.normal(size=(*shape, 4)))


def random_vectors(rng, length, *shape):
    vectors = rng.normal(size=(*shape, 3))
    return length * vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def ramp(s):
    """Minimum jerk from 0 to 1 over s in [0, 1], with two derivatives."""
    return 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s)


def reach(rng, start, goal, duration=1.5, dt=0.005, detour=0.1):
    """A curved path from about start to about goal that neither begins nor ends at rest."""
    start, goal = np.asarray(start, dtype=float), np.asarray(goal, dtype=float)
    time = dt * np.arange(round(duration / dt) + 1)
    duration = time[-1]
    s = (time / duration)[:, None]
    progress, rate, change = ramp(s)
    angle = np.pi * s * rng.uniform(0.5, 2.0, size=start.shape) + rng.uniform(-3, 3, size=start.shape)
    omega = (angle[1] - angle[0]) / s[1]
    return Trajectory(
        time,
        start + (goal - start) * progress + detour * np.sin(angle),
        ((goal - start) * rate + detour * omega * np.cos(angle)) / duration,
        ((goal - start) * change - detour * omega**2 * np.sin(angle)) / duration**2,
    )


def wobbly_turn(rng, turn, wobble=0.2, duration=1.5, dt=0.005, base=quaternion.IDENTITY, axis=(0, 0, 1)):
    """An orientation that turns by `turn` rad about a wobbling axis, from about `base`."""
    time = dt * np.arange(round(duration / dt) + 1)
    axis = np.asarray(axis) / np.linalg.norm(axis)
    side = np.cross(axis, [0.6, 0.0, 0.8])
    frequencies, phases = rng.uniform(1.0, 6.0, size=(2, 1)), rng.uniform(-3, 3, size=(2, 1))

    def orientation(t):
        s = t / time[-1]
        swings = wobble * np.sin(frequencies * s + phases)
        swing = swings[0][:, None] * side + swings[1][:, None] * np.cross(axis, side)
        twist = turn * (0.7 * ramp(s)[0] + 0.3 * s)[:, None] * axis
        turned = quaternion.product(
            quaternion.from_rotation_vector(swing), quaternion.from_rotation_vector(twist)
        )
        return quaternion.product(turned, base)

    h = 3e-4  # s; the differences below are exact to about 1e-7
    here, before, after = orientation(time), orientation(time - h), orientation(time + h)
    forwards, backwards = quaternion.difference(after, here), quaternion.difference(here, before)
    velocity = quaternion.difference(after, before) / (2 * h)
    return OrientationTrajectory(time, here, velocity, (forwards - backwards) / h**2)


def random_quaternion_primitive(rng, *batch, bound=30.0):
    return QuaternionPrimitive(
        weights=rng.uniform(-bound, bound, size=(*batch, 25, 3)),
        start=random_orientations(rng),
        goal=random_orientations(rng),
        velocity=rng.normal(size=3),
        acceleration=5 * rng.normal(size=3),
        duration=float(rng.uniform(0.3, 4.0)),
    )


def random_twist_swing(rng, *batch, turns=1.7, bound=50.0):
    demonstrated = wobbly_turn(rng, 2 * np.pi * turns, base=random_orientations(rng), axis=rng.normal(size=3))
    fitted = fit_twist_swing([demonstrated])
    weights = fitted.chart.weights + rng.uniform(-bound, bound, size=(*batch, 25, 3)) * [1.0, 0.1, 0.1]
    return replace(fitted, chart=replace(fitted.chart, weights=weights))


def fading_coupling(rng, duration, dt, bound, axes=3):
    """A coupling like that of a phase-modulated network: u times a bounded function of the state."""
    tau = canonical.time_constant(duration)
    gains = rng.normal(size=(2, axes))

    def coupling(k, x, xd):
        _, u = canonical.phase(k * dt, tau)
        return bound * u * np.tanh(gains[0] + gains[1] * xd)

    return coupling


def normalised_error(path, target):
    """Mean squared error over the target's variance, all axes together."""
    return np.mean((path - target) ** 2) / np.var(target, axis=0).mean()
