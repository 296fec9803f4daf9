"""The way ahead: cheapest ways in a plane, in closed form and by another algorithm."""

import numpy as np
import pytest
from committed import committed
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from structlearn.avoidance import look_ahead
from structlearn.avoidance.features import MIRROR
from structlearn.avoidance.scene_reaches import SceneLearningParameters
from structlearn.avoidance.shapes import Obstacle, recorded_obstacle
from structlearn.core.frames import local_frame
from structlearn.readers.demonstration import NamedShape
from structlearn.tasks.obstacles.learning import nearest_path_distance, same_gaps

PARAMETERS = committed(SceneLearningParameters, "defaults.obstacles").look_ahead
START, GOAL = np.array([0.0, -0.25, 0.8]), np.array([0.02, 0.17, 0.78])


def box(x, y, half_x=0.05, half_y=0.025):
    return Obstacle("cube", np.array([x, y, 0.79]), np.array([half_x, half_y, 0.06]))


WALL = [box(-0.13, -0.05, 0.2), box(0.37, -0.05, 0.2)]
"""With a gap of 10 cm between x = 0.07 and 0.17."""


def test_in_the_open_the_cost_is_the_distance():
    free = PARAMETERS.model_copy(update={"nearness_cost": 0.0})
    scene = look_ahead.scene_cost_to_go([], START, GOAL, free)
    points = np.random.default_rng(0).uniform([0.0, -0.25], [0.02, 0.15], (200, 2))
    straight = np.linalg.norm(points - GOAL[:2], axis=1)
    assert np.abs(scene.at(points) - straight).max() < 0.5 * look_ahead.CELL_M
    paths = scene.paths(points[:20], [0.05, 5.0])
    assert np.allclose(paths[:, 1], GOAL[:2], atol=1e-9)
    there = np.minimum(0.05 / straight[:20], 1.0)[:, None]
    assert np.abs(paths[:, 0] - (points[:20] + there * (GOAL[:2] - points[:20]))).max() < 0.01


def test_costs_are_those_of_the_cheapest_ways_on_a_graph():
    """Dijkstra over 16 neighbours, whose ways are up to 3 % longer than free ones, on the same weights."""
    scene = look_ahead.scene_cost_to_go(WALL, START, GOAL, PARAMETERS)
    count = scene.cost.shape
    axes = [low + scene.cell * np.arange(n) for low, n in zip(scene.origin, count, strict=True)]
    cells = np.stack(np.meshgrid(*axes, 0.5 * (START[2] + GOAL[2]), indexing="ij"), axis=-1)[:, :, 0]
    weight = look_ahead.way_cost(look_ahead.nearest_distance(WALL, cells), PARAMETERS)
    index = np.arange(weight.size).reshape(count)
    links = []
    for a, b in ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2)):
        low, high = max(0, -b), count[1] - max(0, b)
        first = (slice(0, count[0] - a), slice(low, high))
        second = (slice(a, count[0]), slice(low + b, high + b))
        cost = 0.5 * (weight[first] + weight[second]) * scene.cell * np.hypot(a, b)
        links.append((index[first].ravel(), index[second].ravel(), cost.ravel()))
    rows, columns, costs = (np.concatenate(parts) for parts in zip(*links, strict=True))
    graph = csr_matrix((costs, (rows, columns)), shape=(weight.size,) * 2)
    goal = np.linalg.norm(cells[..., :2] - GOAL[:2], axis=-1).argmin()
    found = dijkstra(graph, directed=False, indices=goal).reshape(count)
    far = np.linalg.norm(cells[..., :2] - GOAL[:2], axis=-1) > 0.1
    free = look_ahead.nearest_distance(WALL, cells) > PARAMETERS.clearance_m  # weights do not jump there
    ratio = scene.cost[far & free] / found[far & free]
    assert np.abs(ratio - 1.0).max() < 0.08


def test_the_way_leads_through_the_gap_and_keeps_clear():
    scene = look_ahead.scene_cost_to_go(WALL, START, GOAL, PARAMETERS)
    path = scene.paths(START[None, :2], np.arange(0.005, 1.0, 0.005))[0]
    assert np.allclose(path[-1], GOAL[:2])
    crossing = path[np.abs(path[:, 1] + 0.05).argmin(), 0]
    assert abs(crossing - 0.12) < 0.02
    at = np.column_stack([path, np.full(len(path), 0.79)])
    assert look_ahead.nearest_distance(WALL, at).min() > 0.025
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert steps.max() < 0.00501  # distances are along the way


def features_of(shapes, start=START, goal=GOAL, seed=3):
    frame, rng = local_frame(start, goal), np.random.default_rng(seed)
    scene = look_ahead.scene_cost_to_go(shapes, start, goal, PARAMETERS)
    position, velocity = rng.normal((0.1, 0.0, 0.0), 0.03, (6, 3)), rng.normal(0, 0.5, (6, 3))
    to_goal = (goal - start) @ frame
    arguments = (start, frame, to_goal)
    mirrored = look_ahead.scene_features(scene, position * MIRROR, velocity * MIRROR, *arguments)
    return look_ahead.scene_features(scene, position, velocity, *arguments), mirrored


def test_features_are_in_the_local_frame_of_a_turned_reach():
    """In the open the path leads straight to the goal, wherever the reach points and the hand is."""
    start, goal = np.array([0.1, -0.1, 0.8]), np.array([0.45, 0.1, 0.8])
    frame = local_frame(start, goal)
    scene = look_ahead.scene_cost_to_go([], start, goal, PARAMETERS.model_copy(update={"nearness_cost": 0.0}))
    position, velocity = np.array([[0.1, 0.05, 0.0], [0.2, -0.04, 0.01]]), np.full((2, 3), 0.3)
    to_goal, ahead = (goal - start) @ frame, np.array(look_ahead.AHEAD_M)
    found = look_ahead.scene_features(scene, position, velocity, start, frame, to_goal)
    left = (to_goal - position)[:, :2]
    length = np.linalg.norm(left, axis=1, keepdims=True)
    expected = (np.minimum(ahead, length) / length)[..., None] * left[:, None]
    np.testing.assert_allclose(found[:, :12].reshape(2, 6, 2), expected, atol=0.01)  # as in the open


def test_a_mirrored_scene_has_mirrored_features():
    goal = np.array(
        [0.0, 0.17, 0.8]
    )  # straight ahead, so that the mirror is the plane x = 0 of the base frame
    mirror = [Obstacle(one.shape, one.centre * [-1, 1, 1], one.half_size) for one in WALL]
    here, there = features_of(WALL, goal=goal)[0], features_of(mirror, goal=goal)[1]
    # grids lie otherwise relative to the boxes, so costs agree to a part of a cell only
    assert np.abs(here * look_ahead.mirror_signs() - there).max() < 0.02


def test_round_and_turned_shapes_are_in_the_way_too():
    half = np.array([0.2, 0.05, 0.12])
    turned = NamedShape(
        "bar", "cube", np.array([0, -0.05, 0.79]), np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]), half
    )
    lying = recorded_obstacle(turned)
    assert lying.signed_distance(np.array([0.0, 0.04, 0.79])) < 0  # it now extends along y
    for shape in (lying, Obstacle("cylinder", np.array([0.0, -0.05, 0.79]), np.array([0.04, 0.04, 0.1]))):
        scene = look_ahead.scene_cost_to_go([shape], START, GOAL, PARAMETERS)
        path = scene.paths(START[None, :2], np.arange(0.01, 1.0, 0.01))[0]
        at = np.column_stack([path, np.full(len(path), 0.79)])
        assert shape.signed_distance(at).min() > 0.03
    above = Obstacle("sphere", np.array([0.01, -0.05, 1.5]), np.full(3, 0.05))
    scene = look_ahead.scene_cost_to_go([above], START, GOAL, PARAMETERS)
    assert scene.at(START[None, :2])[0] < 1.01 * np.linalg.norm((GOAL - START)[:2])


def test_distances_and_gaps_of_paths():
    line = np.column_stack([np.linspace(0, 1, 50), np.zeros(50)])
    assert nearest_path_distance(line, line[::-1]) == 0.0
    assert nearest_path_distance(line, line + np.array([0.0, 0.2])) == pytest.approx(0.2)
    bow = line + np.column_stack([np.zeros(50), 0.3 * np.sin(np.pi * line[:, 0])])
    assert same_gaps(line, bow, [np.array([0.5, 0.4]), np.array([0.5, -0.1])])
    assert not same_gaps(line, bow, [np.array([0.5, 0.1])])
    assert same_gaps(line, bow[::-1][::-1], [])
