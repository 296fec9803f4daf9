"""A baseline, obstacles and avoidance models that the tests of the unrolls share."""

import numpy as np
from committed import committed
from primitives_movements import ramp

from structlearn.avoidance import avoiding_unroll
from structlearn.avoidance.postprocessing import PostprocessingParameters
from structlearn.avoidance.shapes import cloud_batch
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import Trajectory

START, GOAL, DURATION, DT = np.array([0.1, -0.3, 0.2]), np.array([0.7, 0.0, 0.25]), 1.6, 0.02


def baseline(scaled=(False, False, False)):
    """Primitive of a reach of 0.67 m with a bow of 3 cm."""
    time = 0.01 * np.arange(161)
    progress, rate, change = (values[:, None] for values in ramp(time / time[-1]))
    way = GOAL - START + 0.12 * (1 - progress) * np.array([0, 0, 1.0])
    bow = -0.12 * np.array([0, 0, 1.0])
    demonstration = Trajectory(
        time,
        START + progress * way,
        (rate * way + progress * rate * bow) / time[-1],
        (change * way + (2 * rate**2 + progress * change) * bow) / time[-1] ** 2,
    )
    return fit_position([demonstration], scaled)


def spheres(centres, radius=0.05, count=40, motion=None):
    """Evenly spread points on spheres with centres (B, 3)."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    around = np.sqrt(1 - height**2)
    points = np.stack([around * np.cos(angle), around * np.sin(angle), height], axis=1)
    points -= points.mean(axis=0)
    return cloud_batch(np.asarray(centres)[:, None] + radius * points, radius=radius, motion=motion)


def beside_the_reach(rng, batch):
    """Centres about the reach in the local frame, some of them behind the start or beyond the goal."""
    return rng.uniform([-0.2, -0.15, -0.15], [0.9, 0.15, 0.15], size=(batch, 3))


def random_network(rng, size):
    """An untrained network 17-20-10-3 whose outputs are of a given size."""
    first, second, last = rng.normal(size=(17, 20)), rng.normal(size=(20, 10)), rng.normal(size=(10, 3))
    offset = rng.normal(size=20)

    def model(features, phase, phase_velocity):
        hidden = np.maximum(np.maximum(features @ first + offset, 0.0) @ second, 0.0)
        return size * np.tanh(0.02 * hidden @ last)

    return model


LIMITS = committed(PostprocessingParameters, "obstacle_evaluation.postprocessing")


def unroll(primitive, model, obstacles, dt, postprocessing=LIMITS, **options):
    """An unroll whose feedback is limited as in the pipeline."""
    return avoiding_unroll.unroll_avoiding(primitive, model, obstacles, dt, postprocessing, **options)
