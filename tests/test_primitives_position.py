from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from primitives_movements import normalised_error, quick, random_orientations, reach, rngs

from structlearn.core import quaternion
from structlearn.core.frames import local_frame
from structlearn.primitives.position import fit_position

DT = 0.005
SIGNALS = ("position", "velocity", "acceleration")
START, LEVEL, STEEP = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.4, 0.35]), np.array([0.12, 0.2, 0.8])
REACHES = pytest.mark.parametrize(("goal", "kind"), [(LEVEL, "up"), (STEEP, "side"), (START, "world")])


def demonstration(rng, goal, **options):
    detour = 0.0 if goal is START else 0.03
    path = reach(rng, START, goal, **options, detour=detour)
    if goal is START:  # a small loop that ends where it began
        loop = reach(rng, START, START, **options, detour=0.03)
        back = (loop.position[-1] - loop.position[0]) * (loop.time / loop.duration)[:, None]
        rate = (loop.position[-1] - loop.position[0]) / loop.duration
        return type(path)(loop.time, loop.position - back, loop.velocity - rate, loop.acceleration)
    return path


@REACHES
@given(rng=rngs)
@quick
def test_a_smooth_demonstration_is_reproduced(goal, kind, rng):
    taught = demonstration(rng, goal)
    primitive = fit_position([taught])
    assert primitive.frame == kind
    assert primitive.duration == pytest.approx(taught.duration)
    path = primitive.unroll(DT)
    assert np.linalg.norm(path.position - taught.position, axis=1).max() < 1e-3
    assert normalised_error(path.position, taught.position) < 1e-5
    assert normalised_error(path.velocity, taught.velocity) < 1e-4
    np.testing.assert_allclose(path.acceleration[0], taught.acceleration[0], atol=1e-9)


def random_primitive(rng, goal=LEVEL):
    fitted = fit_position([demonstration(rng, goal)])
    return replace(fitted, local=replace(fitted.local, weights=rng.uniform(-300, 300, size=(25, 3))))


@REACHES
@given(rng=rngs)
@quick
def test_turning_start_goal_and_frame_together_turns_the_path(goal, kind, rng):
    primitive = random_primitive(rng, goal)
    turn, shift = random_orientations(rng), rng.normal(size=3)
    state = {name: rng.normal(size=3) for name in ("velocity", "acceleration")}
    turned = {name: quaternion.rotate(turn, value) for name, value in state.items()}
    frame = local_frame(primitive.start, primitive.goal, primitive.frame)
    start, goal = (quaternion.rotate(turn, end) + shift for end in (primitive.start, primitive.goal))
    path = primitive.unroll(DT, **state)
    moved = primitive.unroll(DT, start, goal, frame=quaternion.rotate(turn, frame.T).T, **turned)
    np.testing.assert_allclose(moved.position, quaternion.rotate(turn, path.position) + shift, atol=1e-9)


@given(rngs)
@quick
def test_demonstrations_in_other_directions_are_one_primitive(rng):
    taught = demonstration(rng, LEVEL)
    taught_again = []
    for angle in (0.0, 0.5, -0.4):
        turn = quaternion.from_rotation_vector([0.0, 0.0, angle])
        signals = {name: quaternion.rotate(turn, vars(taught)[name]) for name in SIGNALS}
        taught_again.append(replace(taught, **signals))
    primitive, alone = fit_position(taught_again), fit_position([taught])
    np.testing.assert_allclose(primitive.local.weights[1:], alone.local.weights[1:], atol=1e-3)
    path = primitive.unroll(DT, taught.position[0], taught.position[-1])
    assert np.linalg.norm(path.position - taught.position, axis=1).max() < 1e-3  # IV.6.1


def test_coupling_acts_in_the_local_frame_relative_to_the_start():
    primitive = random_primitive(np.random.default_rng(3))
    seen = []

    def coupling(k, x, xd):
        seen.append(x.copy())
        return np.array([0.0, 50.0, 0.0])

    plain, pushed = primitive.unroll(DT), primitive.unroll(DT, coupling=coupling)
    frame = local_frame(primitive.start, primitive.goal)
    push = (pushed.position - plain.position) @ frame
    np.testing.assert_allclose(push[:, [0, 2]], 0.0, atol=1e-9)
    assert push[-1, 1] > 0.1
    np.testing.assert_allclose(seen[-1], (pushed.position[-1] - primitive.start) @ frame, atol=1e-9)
