import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, rngs

from structlearn.avoidance.postprocessing import Deadline, GoalReach, PostprocessingParameters, post_processed
from structlearn.primitives import transformation

DECAY = committed(PostprocessingParameters, "obstacle_evaluation.postprocessing").passed_decay_per_m2


@pytest.mark.parametrize(
    ("x", "first_x", "factor"),
    [
        (0.3, 0.25, 1.0),  # beside the obstacle
        (0.45, 0.25, np.exp(-0.1)),  # past it, the author's decay of 10 per m^2
        (0.61328, 0.25, 0.5),
        (0.1, 0.66, 1.0),  # level with the goal
        (0.1, 0.661, 0.0),  # beyond it
    ],
)
def test_the_rules_of_the_text_fade_what_acts_across_the_reach(x, first_x, factor):
    c = post_processed(np.array([3.0, -2.0, 5.0]), x, first_x, first_x + 0.1, 0.66, DECAY)
    np.testing.assert_allclose(c, [0.0, -2.0 * factor, 5.0 * factor], rtol=1e-4)


@given(rngs, st.floats(0, 1e4))
@quick
def test_nothing_grows_and_a_batch_is_its_members(rng, decay):
    c, x, ends = rng.normal(size=(6, 3)), rng.uniform(-1, 2, 6), np.sort(rng.uniform(-1, 2, (2, 6)), axis=0)
    acting = post_processed(c, x, *ends, 0.7, decay)
    assert (np.abs(acting) <= np.abs(c)).all()
    alone = [post_processed(c[i], x[i], ends[0, i], ends[1, i], 0.7, decay) for i in range(6)]
    np.testing.assert_array_equal(acting, alone)


STEP, SAMPLES = 1 / 200, 151  # dt / tau; the prescribed end is sample 100
DEADLINES = [Deadline(100, 0.035), Deadline(150, 0.0035)]
RETURN = 10.0


def wild_couplings(rng, size, batch=3):
    """What a broken model may ask for: noise, a bias, and a sign that flips."""
    noise = rng.normal(size=(SAMPLES, batch, 2)) + 2 * rng.normal(size=(1, batch, 2))
    return size * noise * np.sign(np.sin(rng.uniform(0, 0.3) * np.arange(SAMPLES)))[:, None, None]


def driven(couplings, deadlines, return_coupling=RETURN):
    """Deviations (T, B, D) at the samples and the coupling terms that acted."""
    reach = GoalReach(couplings.shape[1:], STEP, deadlines, return_coupling)
    deviations, acted = [], []
    for k, asked in enumerate(couplings):
        deviations.append(reach.deviation[0])
        acted.append(reach.admissible(k, asked))
        reach.advance(acted[-1])
    return np.array(deviations), np.array(acted)


@given(rngs, st.sampled_from([0.1, 10.0, 90.0, 1e6]), st.sampled_from([0.0, 10.0]))
@quick
def test_every_limit_holds_whatever_is_asked_for(rng, size, return_coupling):
    deviations, _ = driven(wild_couplings(rng, size), DEADLINES, return_coupling)
    for deadline in DEADLINES:
        left = np.linalg.norm(deviations[deadline.sample], axis=-1)
        assert (left <= deadline.limit + 1e-12 * size).all()


@given(rngs)
@quick
def test_the_deviation_is_that_of_the_integrator(rng):
    couplings = wild_couplings(rng, 10.0)
    couplings[0] = 0.0
    deviations, acted = driven(couplings, [])
    zero = np.zeros((3, 2))
    forcing, dt = 50 * rng.normal(size=(3, SAMPLES, 2)), STEP  # tau = 1 s
    baseline = transformation.unroll(zero, zero + 0.7, forcing, dt, 1.0)
    path = transformation.unroll(zero, zero + 0.7, forcing, dt, 1.0, coupling=lambda k, x, xd: couplings[k])
    np.testing.assert_array_equal(acted, couplings)
    np.testing.assert_allclose((path.position - baseline.position).swapaxes(0, 1), deviations, atol=1e-11)


def brought_back(state, k, last, return_coupling):
    """Deviation at the deadline if a coupling term of full length leads straight back from here on."""
    left = held(state, last - k, np.zeros((1, 2)))
    return held(state, last - k, -return_coupling * left / np.linalg.norm(left))


def held(state, steps, coupling):
    """Deviation after some steps with one coupling term."""
    reach = GoalReach((1, 2), STEP, [], 0.0)
    reach.deviation = state
    for _ in range(steps):
        reach.advance(coupling)
    return reach.deviation[0]


@given(rngs, st.integers(30, 95))
@quick
def test_what_acts_is_the_nearest_from_which_the_return_coupling_leads_back_in_time(rng, k):
    deadline, reach = Deadline(100, 0.035), GoalReach((1, 2), STEP, [Deadline(100, 0.035)], RETURN)
    for step in range(k):
        reach.advance(reach.admissible(step, np.array([[40.0, 15.0]])))
    before, asked = reach.deviation, np.array([[9e4, -3e4]]) * rng.uniform(0.5, 2.0)
    acts = reach.admissible(k, asked)
    reach.advance(acts)
    left = brought_back(reach.deviation, k + 1, 100, RETURN)
    np.testing.assert_allclose(np.linalg.norm(left), deadline.limit, rtol=1e-6)
    for turn in (-0.1, 0.1):  # anything nearer to what is asked for could not be brought back
        cosine, sine = np.cos(turn), np.sin(turn)
        nearer = asked + 0.999 * (acts - asked) @ np.array([[cosine, sine], [-sine, cosine]])
        again = GoalReach((1, 2), STEP, [], RETURN)
        again.deviation = before
        again.advance(nearer)
        assert np.linalg.norm(brought_back(again.deviation, k + 1, 100, RETURN)) > deadline.limit


@pytest.mark.parametrize("asked", [0.0, 10.0, 90.0])
def test_no_more_than_the_return_coupling_is_needed_against_a_stubborn_model(asked):
    stubborn = np.full((SAMPLES, 1, 1), asked)
    _, acted = driven(stubborn, DEADLINES)
    assert acted.min() >= -RETURN * (1 + 1e-9)
    assert acted.max() <= max(asked, RETURN)


def test_after_the_first_deadline_nothing_acts_but_what_the_next_one_needs():
    reach = GoalReach((1, 2), STEP, DEADLINES, RETURN)
    asked = np.full((1, 2), 40.0)
    assert (reach.admissible(99, asked) != 0.0).any()
    assert (reach.admissible(100, asked) == 0.0).all()  # it is on the baseline
    reach.deviation[0] = 0.5  # too far off to be back by itself
    assert (reach.admissible(100, asked) < 0.0).all()
