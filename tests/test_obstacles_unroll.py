"""Models in the loop of the baseline, and what of their coupling terms acts."""

import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from obstacles_unrolls import (
    DT,
    DURATION,
    GOAL,
    START,
    baseline,
    beside_the_reach,
    random_network,
    spheres,
    unroll,
)
from primitives_movements import few, quick, rngs

from structlearn.avoidance.avoiding_unroll import GoalChange, no_coupling, strongest_pushes
from structlearn.avoidance.features import SCALED_VELOCITY, TO_CENTRE, obstacle_features
from structlearn.avoidance.postprocessing import (
    PUBLISHED_ONLY,
    Deadline,
    GoalReach,
    PostprocessingParameters,
    post_processed,
)
from structlearn.avoidance.shapes import constant_velocity
from structlearn.primitives import canonical, transformation

PRIMITIVE = baseline()
TAU = canonical.time_constant(PRIMITIVE.duration)
END, LATE = round(DURATION / DT), round(1.5 * DURATION / DT)


def constant(*coupling):
    return lambda features, phase, phase_velocity: np.broadcast_to(np.array(coupling), (len(features), 3))


def recorder(model):
    """The model, and the list of what it is shown."""
    shown = []

    def recording(*arguments):
        shown.append(arguments)
        return model(*arguments)

    return recording, shown


def baseline_path(batch=1, **options):
    return unroll(PRIMITIVE, no_coupling, [spheres(np.full((batch, 3), 0.3))], DT, **options).path


@pytest.mark.parametrize("scaled", [(False,) * 3, (True, True, False)])
def test_without_coupling_it_is_the_primitive_s_own_movement(scaled):
    rng, primitive = np.random.default_rng(0), baseline(scaled)
    starts, goals = START + 0.05 * rng.normal(size=(4, 3)), GOAL + 0.05 * rng.normal(size=(4, 3))
    clouds = spheres(beside_the_reach(rng, 4))
    paths = unroll(primitive, no_coupling, [clouds], DT, starts=starts, goals=goals, duration=2.1)
    ours = paths.in_base_frame
    for b in range(4):
        own = primitive.unroll(DT, starts[b], goals[b], 2.1, until=1.5 * 2.1)
        np.testing.assert_allclose(ours.position[b], own.position, atol=1e-12)
        np.testing.assert_allclose(ours.velocity[b], own.velocity, atol=1e-11)
        np.testing.assert_allclose(ours.acceleration[b], own.acceleration, atol=1e-10)
    np.testing.assert_allclose(paths.path.position[:, 0], 0.0, atol=1e-15)
    np.testing.assert_allclose(paths.goal[:, 1:], 0.0, atol=1e-15)  # the goal is on the x axis


@given(rngs)
@few
def test_it_agrees_with_the_primitive_s_own_loop_scenario_by_scenario(rng):
    clouds, model = spheres(beside_the_reach(rng, 3)), random_network(rng, 30.0)
    paths = unroll(PRIMITIVE, model, [clouds], DT, PUBLISHED_ONLY)
    goal_x = np.linalg.norm(GOAL - START)
    assert np.abs(paths.coupling).max() > 1.0
    for b in range(3):
        points, centre = clouds.points[b], clouds.centre[b]

        def coupling(k, x, xd, points=points, centre=centre):
            p, u = canonical.phase(k * DT, TAU)
            seen = obstacle_features(x, xd, TAU, points, centre)
            c = model(seen[None], np.array([p]), np.array([u]))[0]
            c = c * np.array([0, 1, 1]) * np.exp(-10 * max(x[0] - points[:, 0].max(), 0.0) ** 2)
            return np.zeros(3) if k == 0 or goal_x < points[:, 0].min() else c

        own = PRIMITIVE.local.unroll(
            DT, np.zeros(3), np.array([goal_x, 0, 0]), coupling=coupling, until=1.5 * DURATION
        )
        np.testing.assert_allclose(paths.path.position[b], own.position, atol=1e-9)
        np.testing.assert_allclose(paths.path.acceleration[b], own.acceleration, atol=1e-6)


@given(rngs, st.sampled_from([10.0, 90.0, 1e4]), st.booleans())
@quick
def test_the_goal_is_reached_whatever_the_model_and_wherever_the_obstacle(rng, size, stubborn):
    clouds = spheres(beside_the_reach(rng, 8))
    model = constant(*(size * np.sign(rng.normal(size=3)))) if stubborn else random_network(rng, size)
    paths, own = unroll(PRIMITIVE, model, [clouds], DT), baseline_path(8)
    miss = np.linalg.norm(paths.path.position - paths.goal[:, None], axis=-1)
    assert miss[:, END].max() < 0.04
    assert miss[:, LATE].max() < 0.005
    np.testing.assert_allclose(paths.path.position[..., 0], own.position[..., 0], atol=1e-12)


def test_a_moving_obstacle_is_seen_in_its_own_frame():
    velocity = np.array([[0.02, -0.1, 0.05], [0.0, 0.0, 0.0]])
    centres = np.array([[0.3, 0.2, 0.0], [0.4, 0.1, 0.0]])
    model, shown = recorder(constant(0.0, 2.0, 0.0))
    paths = unroll(PRIMITIVE, model, [spheres(centres, motion=constant_velocity(velocity))], DT)
    k = 40
    seen, x, xd = shown[k - 1][0], paths.path.position[:, k], paths.path.velocity[:, k]
    np.testing.assert_allclose(seen[:, TO_CENTRE], centres + k * DT * velocity - x, atol=1e-12)
    np.testing.assert_allclose(seen[:, SCALED_VELOCITY], TAU * (xd - velocity), atol=1e-10)


def test_an_obstacle_that_passes_the_goal_while_it_moves_is_ignored_from_then_on():
    flight = spheres([[0.3, 0.1, 0.0]], motion=lambda time: np.array([0.5 if time > 0.5 else 0.0, 0.0, 0.0]))
    paths = unroll(PRIMITIVE, constant(0.0, 2.0, 0.0), [flight], DT)
    acting = paths.coupling[0, 1:, 1] != 0.0
    np.testing.assert_array_equal(acting, paths.path.time[1:] <= 0.5)


def test_pushes_to_one_side_are_not_added_up_and_those_to_either_side_are():
    terms = np.array([[[3.0, -2.0, 0.0]], [[5.0, 4.0, -1.0]], [[1.0, -7.0, -2.0]]])
    np.testing.assert_array_equal(strongest_pushes(terms), [[5.0, 4.0 - 7.0, -2.0]])
    np.testing.assert_array_equal(strongest_pushes(terms[:1]), terms[0])
    np.testing.assert_array_equal(strongest_pushes(np.repeat(terms[:1], 4, axis=0)), terms[0])


def test_a_change_of_goal_adds_the_step_response_of_a_triple_pole():
    change = GoalChange(0.8, GOAL + np.array([0.05, -0.1, 0.08]))
    own = baseline_path()
    paths = unroll(PRIMITIVE, no_coupling, [spheres([[0.3, 0.2, 0.0]])], DT, goal_change=change)
    elapsed = 12.5 * np.maximum(own.time - 0.8, 0.0) / TAU
    response = 1 - np.exp(-elapsed) * (1 + elapsed + elapsed**2 / 2)
    way = (change.goals - GOAL) @ paths.frame[0]
    np.testing.assert_allclose(paths.path.position[0], own.position[0] + response[:, None] * way, atol=1e-12)
    np.testing.assert_allclose(paths.goal[0] @ paths.frame[0].T + START, change.goals)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"obstacles": []}, "none"),
        ({"obstacles": [spheres([[0.3, 0, 0]]), spheres([[0.3, 0, 0]] * 2)]}, r"\[1, 2\]"),
        ({"goals": START + 0.001}, "scenario 0: a reach shorter"),
        ({"goals": START + np.array([0, 0, 0.5])}, "scenario 0: the reach is parallel"),
        ({"goals": np.full(3, np.nan)}, "scenario 0"),
        ({"goal_change": GoalChange(0.0, GOAL)}, "outside the movement"),
        ({"goal_change": GoalChange(9.0, GOAL)}, "outside the movement"),
        ({"dt": 0.0}, "sampling interval"),
        ({"model": constant(np.nan, 0, 0)}, "wanted are finite"),
        ({"model": lambda features, p, u: features}, r"\(1, 17\)"),
    ],
)
def test_bad_input_is_refused_with_a_message(options, message):
    arguments = {"model": no_coupling, "obstacles": [spheres([[0.3, 0.1, 0.0]])], "dt": DT} | options
    with pytest.raises(ValueError, match=message):
        unroll(PRIMITIVE, **arguments)


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
