import numpy as np
from hypothesis import given
from primitives_movements import quick, random_orientations, reach, rngs, wobbly_turn

from structlearn.primitives.trajectory import differentiated, differentiated_orientation

DT = 1 / 300
INSIDE = slice(60, -60)  # the filter's reflection disturbs the ends


@given(rngs)
@quick
def test_a_recorded_signal_gets_its_derivatives(rng):
    truth = reach(rng, np.zeros(3), np.ones(3), dt=DT)
    found = differentiated(truth.position, DT, cutoff_hz=40.0)
    assert found.duration == truth.duration
    np.testing.assert_allclose(found.dt, DT)
    np.testing.assert_allclose(found.position[INSIDE], truth.position[INSIDE], atol=1e-5)
    np.testing.assert_allclose(found.velocity[INSIDE], truth.velocity[INSIDE], atol=1e-3)
    np.testing.assert_allclose(found.acceleration[INSIDE], truth.acceleration[INSIDE], atol=1e-2)


@given(rngs)
@quick
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
