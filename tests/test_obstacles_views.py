"""The recordings of the obstacle testbed, of a small world."""

import numpy as np
import pandas as pd
import pytest
from obstacles_world import PLACES, POPULATION, PRIMITIVE, demonstrations, evaluation
from viewer_files import colour_of, contents, note, values, view_names

from structlearn.avoidance.shapes import SHAPES
from structlearn.testbeds.obstacles.names import FREE, HIT, KINDS, SOURCES, model_name
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import (
    SituationKey,
    groups_of,
    hit_settings,
    reaches_by_situation,
    without_avoidance,
)
from structlearn.testbeds.obstacles.views import demonstrated_avoidance as drawn
from structlearn.testbeds.obstacles.views.demonstrated_avoidance import (
    shown_scenarios,
    write_trained_avoidance,
)
from structlearn.testbeds.obstacles.views.unseen_avoidance import write_unseen_avoidance

UNSEEN = avoidance_protocols.unseen(PRIMITIVE)


def own_scores():
    scores, _, _ = evaluation()
    return scores[scores["person"] == POPULATION.shown]


@pytest.fixture(scope="module")
def reaches():
    return reaches_by_situation(evaluation()[1], own_scores(), PRIMITIVE)


@pytest.fixture(scope="module")
def shown(reaches):
    """The first setting of every shape."""
    samples = pd.DataFrame(
        {"scenario": [0, 0, 3, 3, 6, 6], "demonstration": [0, 1] * 3, "time_s": 6 * [0.5]}
    ).assign(target_x=0.0, target_y=np.arange(6.0), target_z=1.0)
    names = [place.name for place in PLACES[::3]]
    return shown_scenarios(PLACES, names, lambda _: demonstrations(), samples, reaches, 30)


def test_reaches_are_those_of_the_tables(reaches):
    its, found = reaches[SituationKey("trained", "cube", 2)], own_scores()
    assert without_avoidance(its) is its[0]
    scores = found[(found["protocol"] == "trained") & (found["obstacle"] == "cube")]
    scores = scores[(scores["scenario"] == 2) & (scores["rules"] == avoidance_protocols.LIMITED)]
    scores = scores.set_index(["model", "learned_from"])
    assert len(its) == len(scores)
    for reach in its:
        row = scores.loc[(reach.model, reach.learned_from)]
        assert (reach.obstacle_distance, reach.hit) == (row["obstacle_distance"], row["hit"])
    assert sum(len(reach.time) for group in reaches.values() for reach in group) == len(evaluation()[1])
    x = (PRIMITIVE.goal - PRIMITIVE.start) / np.linalg.norm(PRIMITIVE.goal - PRIMITIVE.start)
    np.testing.assert_allclose(its[1].coupling_in_base @ x, its[1].coupling[:, 0], atol=1e-9)
    assert np.abs(its[1].coupling).max() > 0.1


@pytest.mark.parametrize("shape", SHAPES)
def test_a_solid_is_as_large_as_its_obstacle_and_turned_as_far(tmp_path, shown, shape):
    path = tmp_path / "trained.rrd"
    one = next(one for one in shown if one.scenario.shape == shape)
    write_trained_avoidance(path, [one], "Solid")
    kind = {"sphere": "Ellipsoids3D", "cube": "Boxes3D", "cylinder": "Cylinders3D"}[shape]
    solid = {
        name: np.array(values(path, f"/{shape}\\/01/obstacle/solid", f"{kind}:{name}"), float).squeeze()
        for name in ("centers", "quaternions", "half_sizes", "lengths", "radii")
    }
    np.testing.assert_allclose(solid["centers"], one.scenario.obstacle.centre, rtol=1e-6)
    np.testing.assert_allclose(solid["quaternions"], [0.0, 0.0, np.sin(0.25), np.cos(0.25)], atol=1e-6)
    half = one.scenario.obstacle.half_size
    if shape == "cylinder":
        np.testing.assert_allclose([solid["radii"], solid["lengths"]], [half[0], 2 * half[2]], rtol=1e-6)
    else:
        np.testing.assert_allclose(solid["half_sizes"], half, rtol=1e-6)


def test_models_stand_beside_the_demonstrations_that_they_learned_from(tmp_path, shown):
    path = tmp_path / "trained.rrd"
    write_trained_avoidance(path, shown, "Trained")
    rows, _, timelines = contents(path)
    assert timelines == {"time"}
    for one in shown:
        tab = f"/{one.scenario.shape}\\/01"
        for reach in one.reaches[1:]:
            look = SOURCES[reach.learned_from]
            label, samples = look.name.replace(" ", "\\ "), len(reach.time)
            scene = f"{tab}/{reach.model}/{label}"
            assert rows[f"{scene}/hand"] == rows[f"{tab}/distance/{reach.model}/{label}"] == samples
            assert rows[f"{tab}/terms/{reach.model}/upwards/{label}"] == samples
            assert colour_of(path, f"{scene}/path", "LineStrips3D") == look.colour
            assert f" {model_name(reach.model, reach.learned_from)} |" in note(path, f"/notes{tab}")
        origins = values(path, f"{tab}/network/per\\ setting/coupling", "Arrows3D:origins")[0]
        np.testing.assert_allclose(origins, one.reaches[1].position[:: drawn.ARROW_EVERY], atol=1e-6)
        assert rows[f"{tab}/demonstrated\\ terms/to\\ the\\ left/1"] == 1
    assert {look.name for kind, look in KINDS.items() if kind != "none"} <= set(view_names(path))


def test_every_unseen_sphere_is_a_step_with_its_colour_and_paths(tmp_path, reaches):
    path = tmp_path / "unseen.rrd"
    write_unseen_avoidance(path, UNSEEN, groups_of(UNSEEN, reaches), PRIMITIVE, "Unseen")
    rows, _, timelines = contents(path)
    assert timelines == {"sphere"}
    for name in (*SHAPES, "all"):
        assert rows[f"/one/paths/{name}"] == rows[f"/closest/{name}"] == 63
        assert colour_of(path, f"/all/{name}", "LineStrips3D") == SOURCES[name].colour
    assert rows["/one/sphere"] == rows["/closest/no\\ avoidance"] == 63
    hit = {number for _, number in hit_settings(reaches, "unseen")}
    assert 0 < len(hit) < 63
    expected = [(HIT if number in hit else FREE).colour for number in range(1, 64)]
    colours = values(path, "/one/sphere/cloud", "Points3D:colors")
    assert [f"#{one[0] >> 8:06x}" for one in colours] == expected
    assert len(values(path, "/notes/sphere", "TextDocument:text")) == 63
    assert f"| {KINDS['none'].name} | {len(hit)} |" in note(path)
    assert "simulated" in note(path)
