import numpy as np
from primitives_movements import for_few_rngs, for_rngs, random_orientations, reach, wobbly_turn
from scipy.integrate import solve_ivp

from structlearn.primitives.trajectory import Trajectory, differentiated, differentiated_orientation
from structlearn.primitives.transformation import ALPHA, ALPHA_G, BETA, forcing_target, initial_goal, unroll


def random_situation(rng, axes=2):
    start, goal, velocity, acceleration = rng.normal(size=(4, axes))
    return {"start": start, "goal": goal, "velocity": velocity, "acceleration": 5 * acceleration}


def assert_path(found, expected, *tolerances):
    """Position, velocity and, with a third tolerance, acceleration."""
    names = ("position", "velocity", "acceleration")
    for name, atol in zip(names, tolerances, strict=False):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=atol)


def text_solution(times, forcing, tau, start, goal, velocity, acceleration, first=None, **options):
    """The text's equations (eq. IV.1, IV.10, IV.12) by scipy, without accelerations."""
    axes = len(start)
    first = forcing(0.0) if first is None else first

    def rates(t, state):
        x, xd, g = state.reshape(3, axes)
        xdd = (ALPHA * (BETA * (g - x) - tau * xd) + forcing(t)) / tau**2
        return np.concatenate([xd, xdd, ALPHA_G * (goal - g) / tau])

    state = np.concatenate([start, velocity, initial_goal(start, velocity, acceleration, tau, first)])
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, **options}
    solution = solve_ivp(rates, (times[0], times[-1]), state, t_eval=times, **options)
    return Trajectory(times, solution.y[:axes].T, solution.y[axes : 2 * axes].T, np.empty(0))


def test_the_constants_are_the_text_s_and_critically_damped():
    assert (ALPHA, BETA, ALPHA_G) == (25.0, 25.0 / 4, 25.0 / 2)


@for_few_rngs
def test_forcing_that_is_linear_between_samples_is_integrated_exactly(rng):
    tau, dt = rng.uniform(1.0, 5.0), 0.1
    times, samples = dt * np.arange(9), rng.uniform(-100, 100, size=(9, 2))
    situation = random_situation(rng)
    path = unroll(forcing=samples, dt=dt, tau=tau, **situation)

    def forcing(t):
        return np.array([np.interp(t, times, column) for column in samples.T])

    assert_path(path, text_solution(times, forcing, tau, **situation, max_step=dt / 2), 1e-6, 1e-5)

    fine = np.stack([forcing(t) for t in dt / 8 * np.arange(65)])
    finer = unroll(forcing=fine, dt=dt / 8, tau=tau, **situation)
    np.testing.assert_allclose(finer.position[::8], path.position, atol=1e-11)  # the step does not matter
    np.testing.assert_allclose(finer.velocity[::8], path.velocity, atol=1e-10)
    np.testing.assert_allclose(finer.acceleration[::8], path.acceleration, atol=1e-9)


@for_rngs
def test_the_path_starts_in_the_state_asked_for(rng):
    situation = random_situation(rng)
    forcing, c = rng.uniform(-100, 100, size=(5, 2)), rng.uniform(-100, 100, size=2)
    for coupling in (None, lambda *_: c):
        path = unroll(forcing=forcing, dt=0.01, tau=3.0, coupling=coupling, **situation)
        np.testing.assert_allclose(path.position[0], situation["start"], atol=1e-14)
        np.testing.assert_allclose(path.velocity[0], situation["velocity"], atol=1e-14)
        np.testing.assert_allclose(path.acceleration[0], situation["acceleration"], atol=1e-11)  # eq. IV.12


@for_few_rngs
def test_a_batch_is_its_movements_one_by_one(rng):
    forcing = rng.uniform(-100, 100, size=(3, 4, 20, 2))
    start, velocity, acceleration = rng.normal(size=(3, 3, 4, 2))
    goal = rng.normal(size=2)
    gain = rng.normal()
    for coupling in (None, lambda k, x, xd: gain * k * x - xd):
        batch = unroll(start, goal, forcing, 0.05, 2.0, velocity, acceleration, coupling)
        assert batch.position.shape == (3, 4, 20, 2)
        for i, j in np.ndindex(3, 4):
            alone = unroll(
                start[i, j], goal, forcing[i, j], 0.05, 2.0, velocity[i, j], acceleration[i, j], coupling
            )
            np.testing.assert_allclose(batch.position[i, j], alone.position, atol=1e-12)
            np.testing.assert_allclose(batch.velocity[i, j], alone.velocity, atol=1e-12)
            np.testing.assert_allclose(batch.acceleration[i, j], alone.acceleration, atol=1e-10)


def test_coupling_is_held_over_the_step():
    rng = np.random.default_rng(1)
    tau, dt, held = 2.0, 0.1, rng.uniform(-100, 100, size=(8, 2))
    situation = random_situation(rng)
    path = unroll(forcing=np.zeros((8, 2)), dt=dt, tau=tau, coupling=lambda k, x, xd: held[k], **situation)

    def staircase(t):
        return held[min(int(t / dt + 1e-9), 7)]

    options = {"max_step": dt / 50, "rtol": 1e-8}
    assert_path(path, text_solution(dt * np.arange(8), staircase, tau, **situation, **options), 2e-4)


def test_coupling_sees_every_sample_of_the_path():
    seen = {}

    def spring(k, x, xd):
        seen[k] = np.concatenate([x, xd])
        return -20 * x - 5 * xd

    situation = random_situation(np.random.default_rng(2))
    path = unroll(forcing=np.zeros((30, 2)), dt=0.02, tau=1.0, coupling=spring, **situation)
    assert list(seen) == list(range(30))
    expected = np.concatenate([path.position, path.velocity], axis=1)
    np.testing.assert_allclose(np.stack(list(seen.values())), expected, atol=1e-12)


@for_rngs
def test_the_target_of_an_unrolled_path_is_its_forcing(rng):
    duration, dt = 1.5, 0.01
    tau = 2 * duration
    forcing = rng.uniform(-100, 100, size=(151, 2))
    situation = random_situation(rng)
    path = unroll(forcing=forcing, dt=dt, tau=tau, **situation)
    target = forcing_target(path, tau)
    # eq. IV.8 takes the last position as the goal and knows no forcing at the start (u = 0 there)
    g_error = situation["goal"] - path.position[-1]
    decay = np.exp(-ALPHA_G * path.time / tau)[:, None]
    expected = forcing + ALPHA * BETA * ((1 - decay) * g_error - decay * forcing[0] / (ALPHA * BETA))
    np.testing.assert_allclose(target, expected, atol=1e-9)


DT = 1 / 300
INSIDE = slice(60, -60)  # the filter's reflection disturbs the ends


@for_rngs
def test_a_recorded_signal_gets_its_derivatives(rng):
    truth = reach(rng, np.zeros(3), np.ones(3), dt=DT)
    found = differentiated(truth.position, DT, cutoff_hz=40.0)
    assert found.duration == truth.duration
    np.testing.assert_allclose(found.dt, DT)
    np.testing.assert_allclose(found.position[INSIDE], truth.position[INSIDE], atol=1e-5)
    np.testing.assert_allclose(found.velocity[INSIDE], truth.velocity[INSIDE], atol=1e-3)
    np.testing.assert_allclose(found.acceleration[INSIDE], truth.acceleration[INSIDE], atol=1e-2)


@for_rngs
def test_a_recorded_orientation_gets_its_derivatives_in_the_base_frame(rng):
    truth = wobbly_turn(rng, 4 * np.pi, dt=DT, base=random_orientations(rng), axis=rng.normal(size=3))
    flipped = truth.orientation * rng.choice([-1.0, 1.0], size=(len(truth.time), 1))
    found = differentiated_orientation(flipped, DT, cutoff_hz=60.0)
    np.testing.assert_allclose(np.linalg.norm(found.orientation, axis=1), 1.0, atol=1e-12)
    assert (np.sum(found.orientation[1:] * found.orientation[:-1], axis=1) > 0.9).all()
    overlap = np.abs(np.sum(found.orientation * truth.orientation, axis=1))
    np.testing.assert_allclose(overlap[INSIDE], 1.0, atol=1e-7)
    np.testing.assert_allclose(found.angular_velocity[INSIDE], truth.angular_velocity[INSIDE], atol=2e-2)
    np.testing.assert_allclose(
        found.angular_acceleration[INSIDE], truth.angular_acceleration[INSIDE], atol=0.5
    )


def test_a_cut_restarts_the_clock_and_keeps_both_ends():
    path = reach(np.random.default_rng(0), np.zeros(3), np.ones(3), duration=1.0, dt=0.01)
    part = path.cut(20, 50)
    np.testing.assert_array_equal(part.position, path.position[20:51])
    np.testing.assert_array_equal(part.acceleration, path.acceleration[20:51])
    np.testing.assert_allclose(part.time, 0.01 * np.arange(31), atol=1e-15)
