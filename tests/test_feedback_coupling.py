import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import torch
from committed import committed
from feedback_toy import toy_dataset
from primitives_movements import for_few_rngs, for_rngs, ramp, reach, wobbly_turn

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback.corrected_paths import (
    corrected_paths,
    coupling_response,
    split_demonstrations,
    unrolled_error,
)
from structlearn.feedback.coupling import orientation_target, position_target
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.models.ffnn import FeedForwardNetwork
from structlearn.feedback.trainers import UnrolledTrainingParameters
from structlearn.feedback.training.pmnn import StackedPhaseModulatedNetworks, train_unrolled
from structlearn.primitives import canonical, transformation
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.vector import fit_vector

COARSE, FINE = 0.004, 0.001  # s


def vector_pair(rng, dt=0.002):
    """A nominal primitive, and a corrected demonstration of another duration."""
    nominal = fit_vector([reach(rng, np.zeros(3), [0.5, 0.2, -0.1], dt=0.005)])
    return nominal, reach(rng, [0.02, 0.0, -0.01], [0.5, 0.2, 0.0], duration=1.2, dt=dt, detour=0.2)


def orientation_pair(rng, dt=0.002):
    nominal = fit_quaternion([wobbly_turn(rng, 1.0)])
    return nominal, wobbly_turn(rng, 1.2, wobble=0.4, duration=1.2, dt=dt)


def unrolled(nominal, path, start, target, goal):
    """The nominal primitive from the initial state of a path, with its target as coupling."""
    velocity, acceleration = (rate[0] for rate in path.rates)
    coupling = lambda k, x, xd: target[k]  # noqa: E731
    return nominal.unroll(path.dt, start, goal, path.duration, velocity, acceleration, coupling)


def position_error(seed, dt, goal):
    """Largest distance from the demonstration."""
    nominal, path = vector_pair(np.random.default_rng(seed), dt)
    again = unrolled(nominal, path, path.position[0], position_target(path, nominal, goal), goal)
    return np.linalg.norm(again.position - path.position, axis=1).max()


def orientation_error(seed, dt, goal):
    nominal, path = orientation_pair(np.random.default_rng(seed), dt)
    again = unrolled(nominal, path, path.orientation[0], orientation_target(path, nominal, goal), goal)
    return quaternion.angle_between(again.orientation, path.orientation).max()


@pytest.mark.parametrize(
    ("error", "goal", "limit"),
    [
        (position_error, None, 0.01),  # m, of a reach of half a metre
        (position_error, np.array([0.4, 0.3, 0.1]), 0.01),
        (orientation_error, None, 0.03),  # rad
        (orientation_error, quaternion.from_rotation_vector(np.array([0.1, -0.2, 1.3])), 0.03),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_a_primitive_with_its_target_as_coupling_is_the_demonstration(error, goal, limit, seed):
    """But for the hold of the coupling over a step, which shrinks with the step."""
    coarse, fine = error(seed, COARSE, goal), error(seed, FINE, goal)
    assert coarse < limit
    assert fine < 0.35 * coarse


@for_few_rngs
def test_what_needs_no_correction_has_no_target(rng):
    nominal, _ = vector_pair(rng)
    start, goal = rng.normal(size=(2, 3))
    path = nominal.unroll(0.004, start, goal, 1.0, *rng.normal(size=(2, 3)))
    terms = nominal.forcing(path.time, start, goal, path.duration)
    assert np.abs(position_target(path, nominal, goal)).max() < 1e-9 * np.abs(terms).max()
    nominal, _ = orientation_pair(rng)
    turn = quaternion.from_rotation_vector(0.1 * rng.normal(size=3))
    path = nominal.unroll(0.004, quaternion.product(turn, nominal.start), None, 1.2, *rng.normal(size=(2, 3)))
    terms = nominal.forcing(path.time, path.duration)
    assert np.abs(orientation_target(path, nominal)).max() < 1e-9 * np.abs(terms).max()


@for_few_rngs
def test_the_sign_of_a_quaternion_does_not_matter(rng):
    nominal, path = orientation_pair(rng)
    flipped = replace(path, orientation=-path.orientation)
    np.testing.assert_allclose(
        orientation_target(flipped, nominal, -nominal.goal), orientation_target(path, nominal), atol=1e-9
    )


@for_rngs
def test_coupling_adds_its_response_to_any_nominal_movement(rng):
    dt, tau = rng.uniform(0.001, 0.05), rng.uniform(0.5, 8.0)
    state = {name: rng.normal(size=(3, 2)) for name in ("start", "goal", "velocity", "acceleration")}
    forcing, coupling = 50 * rng.normal(size=(2, 3, 60, 2))
    corrected, nominal = (
        transformation.unroll(
            forcing=forcing, dt=dt, tau=tau, coupling=lambda k, x, xd, c=c: c[:, k], **state
        ).position
        for c in (coupling, 0.0 * coupling)
    )
    expected = coupling_response(60, dt / tau) @ coupling
    np.testing.assert_allclose(corrected - nominal, expected, rtol=1e-9, atol=1e-9)


ROLL = np.array([1.0, 0.0, 0.0])


def corrected_demonstration(primitive, largest, dt):
    """A nominal movement turned further by a minimum-jerk roll, and that roll (T,)."""
    nominal = primitive.unroll(dt)
    roll, rate, change = (
        largest * values[:, None] / nominal.duration**order * ROLL
        for order, values in enumerate(ramp(nominal.time / nominal.duration))
    )
    turn = quaternion.from_rotation_vector(roll)
    velocity = quaternion.rotate(turn, nominal.angular_velocity)
    acceleration = quaternion.rotate(turn, nominal.angular_acceleration) + np.cross(rate, velocity)
    path = OrientationTrajectory(
        nominal.time, quaternion.product(turn, nominal.orientation), rate + velocity, change + acceleration
    )
    return path, roll[:, 0]


def dataset_of(time, target, setting=10.0, demonstration=0, deviation=None):
    p, u = canonical.phase(time, canonical.time_constant(time[-1]))
    return CouplingDataset(
        deviation=np.zeros((len(time), 2)) if deviation is None else deviation,
        phase=p,
        phase_velocity=u,
        target=target,
        setting=np.full(len(time), setting),
        demonstration=np.full(len(time), demonstration),
        time=time,
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_demonstrated_roll_follows_from_the_coupling_targets_alone(seed):
    rng = np.random.default_rng(seed)
    base = quaternion.from_rotation_vector(rng.normal(size=3))
    movement = wobbly_turn(rng, np.radians(4), np.radians(1.3), 2.6, 1 / 300, base, axis=(0, 0.6, 0.8))
    primitive = fit_quaternion([movement])
    path, roll = corrected_demonstration(primitive, np.radians(10), 1 / 300)
    target = orientation_target(path, primitive) @ ROLL
    paths = corrected_paths(dataset_of(path.time, target), 250)
    expected = np.interp(np.linspace(0, path.time[-1], 250), path.time, roll)
    assert np.degrees(np.abs(paths.correction[0] - expected).max()) < 0.01
    # held over 250 steps, as the feedback is, it comes half a step later: 10 degrees * 1.9 / 500
    assert np.degrees(np.abs(paths.response @ paths.target[0] - expected).max()) < 0.06


def test_demonstrations_are_told_apart_sorted_and_resampled():
    parts = []
    for setting, number, count in ((5.0, 1, 90), (2.5, 0, 60), (5.0, 0, 75)):
        time = np.arange(count) / 100
        columns = np.column_stack([np.full(count, 10 * setting + number), time / time[-1]])
        parts.append(dataset_of(time, columns[:, 1] ** 2, setting, number, columns))
    rows = concatenated(parts)
    shuffled = rows.where(np.random.default_rng(0).permutation(len(rows.time)))
    paths = corrected_paths(shuffled, 31)
    assert list(zip(paths.setting, paths.demonstration, strict=True)) == [(2.5, 0), (5.0, 0), (5.0, 1)]
    np.testing.assert_allclose(paths.deviation[:, :, 0], np.outer([25.0, 50.0, 51.0], np.ones(31)))
    s = np.linspace(0, 1, 31)
    np.testing.assert_allclose(paths.deviation[:, :, 1], np.tile(s, (3, 1)), atol=1e-12)
    np.testing.assert_allclose(paths.target, np.tile(s**2, (3, 1)), atol=1e-4)


def test_half_a_movement_is_refused():
    time = np.arange(100) / 100
    whole = dataset_of(time, np.zeros(100))
    with pytest.raises(InputError, match=r"setting 10, demonstration 0: not on a uniform clock"):
        corrected_paths(whole.where(np.arange(60)), 50)


def random_paths(numbers=6, settings=(2.5, 5.0, 10.0), samples=60):
    return corrected_paths(toy_dataset(numbers, settings, (samples, samples)), samples)


def untrained(paths, hidden=(4,), seed=0):
    generator = torch.Generator().manual_seed(seed)
    stack = StackedPhaseModulatedNetworks(1, paths.deviation.shape[2], hidden, 25, 0.0, generator)
    mean, scale = paths.deviation.mean(axis=(0, 1)), paths.deviation.std(axis=(0, 1))
    return stack.to_network(0, mean, scale, float(paths.target.std()))


def rms_deg(network, paths):
    return float(np.degrees(np.sqrt(np.mean(unrolled_error(network, paths) ** 2))))


def test_the_unrolled_error_is_that_of_the_primitive_in_the_loop():
    paths = random_paths(numbers=1, settings=(5.0,))
    network, zero = untrained(paths), np.zeros(1)
    dt, tau = 0.6 / 59, canonical.time_constant(0.6)
    coupling = network.coupling(paths.deviation[0], *paths.phase)[:, None]
    path = transformation.unroll(
        zero, zero, np.zeros((60, 1)), dt, tau, coupling=lambda k, x, xd: coupling[k]
    )
    expected = np.sqrt(np.mean((path.position[:, 0] - paths.correction[0]) ** 2))
    np.testing.assert_allclose(unrolled_error(network, paths), [expected], rtol=1e-9)
    assert expected > 0


QUICK = committed(
    UnrolledTrainingParameters, "train_feedback.unrolled", steps=200, learning_rate=3e-3, dropout=0.0
)


def test_a_network_knocked_off_is_put_right_from_the_path_alone():
    paths = random_paths(numbers=12)
    teacher = untrained(paths, seed=1)
    said = teacher.coupling(paths.deviation, *paths.phase)
    exact = dataclasses.replace(paths, target=np.ones_like(said), correction=said @ paths.response.T)
    training, validation = split_demonstrations(exact, 0.2, seed=0)
    noise = 1.0 + 0.5 * np.random.default_rng(0).normal(size=25)
    start = dataclasses.replace(teacher, output_weights=noise * teacher.output_weights)
    only_path = QUICK.model_copy(update={"coupling_loss_weight": 0.0})
    learnt = train_unrolled(training, validation, start, only_path)
    assert rms_deg(learnt, validation) < 0.2 * rms_deg(start, validation)


def test_a_training_that_leads_astray_keeps_the_initial_network():
    training, validation = split_demonstrations(random_paths(), 0.3, seed=0)
    start = train_unrolled(training, validation, untrained(training), QUICK)
    wild = QUICK.model_copy(update={"steps": 3, "learning_rate": 10.0})
    assert train_unrolled(training, validation, start, wild) is start


def test_without_any_correction_there_is_nothing_to_learn():
    paths = random_paths()
    nothing = np.zeros_like(paths.target)
    idle = dataclasses.replace(paths, target=nothing, correction=nothing)
    with pytest.raises(InputError, match="nothing was corrected"):
        train_unrolled(idle, idle, untrained(paths), QUICK)


def test_only_the_phase_modulated_network_is_trained_in_the_unroll():
    paths, zeros = random_paths(), np.zeros((1, 38))
    other = FeedForwardNetwork(zeros[0], np.ones(38), ((zeros, np.zeros(1)),))
    with pytest.raises(InputError, match="only the PMNN can be trained in the unroll, not a FeedForward"):
        train_unrolled(paths, paths, other, QUICK)
