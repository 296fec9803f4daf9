from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from obstacles_unrolls import baseline
from rerun.chunk import RrdReader
from test_viewer import contents, view_names

from structlearn.avoidance.learned_models import ALL, NETWORK, SETTING, AvoidanceModels
from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.ground.errors import InputError
from structlearn.palette import GREY, VERMILION
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.recordings import avoidance_scene as drawn
from structlearn.testbeds.obstacles.recordings.changing_avoidance import (
    shown_reaches,
    sphere_paths,
    write_changing_avoidance,
)
from structlearn.testbeds.obstacles.recordings.demonstrated_avoidance import write_avoidance_demonstrations
from structlearn.testbeds.obstacles.recordings.shown_reaches import (
    ShownScenario,
    SituationKey,
    chosen_scenarios,
    hit_settings,
    of_baseline,
    reaches_by_situation,
)
from structlearn.testbeds.obstacles.recordings.trained_avoidance import write_trained_avoidance
from structlearn.testbeds.obstacles.recordings.unseen_avoidance import (
    in_base_frame,
    situation_keys,
    write_unseen_avoidance,
)
from structlearn.testbeds.obstacles.world.scenarios import UNSEEN_RADIUS_M, Scenario

PRIMITIVE = baseline()
PARAMETERS = avoidance_protocols.AvoidanceEvaluationParameters(
    rate_hz=25.0, kept_every=1, speeds_m_s=(0.1,), pairs=6, goal_change_s=0.4
)
PLACES = [
    Scenario(number, obstacle(shape, np.array(centre), yaw=0.5))
    for shape in SHAPES
    for number, centre in enumerate(([0.4, -0.15, 0.25], [0.4, -0.45, 0.3]), start=1)
]


@dataclass(frozen=True)
class Push:
    """A model that pushes upwards wherever the obstacle is."""

    size: float

    def __call__(self, features, phase, phase_velocity):
        return np.tile([0.0, 0.0, self.size], (len(features), 1))

    def take(self, scenarios):
        return self


@pytest.fixture(scope="module")
def tables():
    """Paths and scores of all situations."""
    models = {SETTING: Push(5.0), ALL: Push(3.0)} | {shape: Push(4.0) for shape in SHAPES}
    learned = AvoidanceModels(networks=models, human_inspired={SETTING: Push(9.0)}, phase_modulated={})
    situations = avoidance_protocols.situations(PLACES, PRIMITIVE, PARAMETERS)
    found = [avoidance_protocols.evaluate(one, learned, PRIMITIVE, PARAMETERS) for one in situations]
    scores, paths = (pd.concat(tables, ignore_index=True) for tables in zip(*found, strict=True))
    return paths, scores


@pytest.fixture(scope="module")
def reaches(tables):
    return reaches_by_situation(*tables, PRIMITIVE)


@pytest.fixture(scope="module")
def shown(reaches):
    """The first setting of every shape with two demonstrations each."""
    time = np.arange(40) / 25.0
    path = PRIMITIVE.unroll(1 / 25.0).position[:40]
    people = [
        Demonstration(name, time, path + 0.01 * number, provenance={"origin": "simulated"})
        for number, name in enumerate(("01", "02"))
    ]
    targets = pd.DataFrame({"demonstration": [0, 0, 1, 1], "time_s": [0.0, 1.0] * 2})
    targets[["target_x", "target_y", "target_z"]] = np.arange(12.0).reshape(4, 3)
    return [
        ShownScenario(
            place,
            place.obstacle.cloud(30),
            people,
            targets,
            reaches[SituationKey(avoidance_protocols.TRAINED, place.shape, place.setting)],
        )
        for place in PLACES[::2]
    ]


def values(path, entity, component):
    """Values of a component of an entity in the order of time, static ones first."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return [value for value in found if value is not None]


def texts(path, entity):
    return [value[0] for value in values(path, entity, "TextDocument:text")]


def test_reaches_are_those_of_the_tables(tables, reaches):
    paths, scores = tables
    key = SituationKey(avoidance_protocols.TRAINED, "cube", 2)
    its = reaches[key]
    assert [reach.label for reach in its] == [
        "baseline",
        "this scenario",
        "all cubes",
        "all shapes",
        "this scenario",
    ]
    assert {reach.model for reach in its} == {avoidance_protocols.NO_MODEL, NETWORK, "human_inspired"}
    for reach in its:
        same = (
            (scores["protocol"] == key.protocol) & (scores["obstacle"] == "cube") & (scores["scenario"] == 2)
        )
        same &= (scores["model"] == reach.model) & (scores["learned_from"] == reach.learned_from)
        row = scores[same & (scores["rules"] == avoidance_protocols.LIMITED)].iloc[0]
        assert reach.obstacle_distance == row["obstacle_distance"]
        assert reach.hit == (row["obstacle_distance"] <= 0)
    assert sum(len(reach.time) for group in reaches.values() for reach in group) == len(paths)
    last = its[1]
    np.testing.assert_allclose(last.coupling_in_base @ baseline_frame(), last.coupling, atol=1e-9)
    assert np.abs(last.coupling).max() > 0.1
    np.testing.assert_allclose(of_baseline(its).position[0], PRIMITIVE.start, atol=1e-6)


def baseline_frame():
    """Columns: the local axes in the base frame, by definition (IV.6.1)."""
    x = (PRIMITIVE.goal - PRIMITIVE.start) / np.linalg.norm(PRIMITIVE.goal - PRIMITIVE.start)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def test_hits_are_those_of_the_baseline(reaches):
    hit = hit_settings(reaches, avoidance_protocols.UNSEEN)
    expected = {
        ("sphere", key.number)
        for key, group in reaches.items()
        if key.protocol == "unseen"
        and np.linalg.norm(group[0].position - sphere_centre(key.number), axis=1).min() < 0.045
    }
    assert expected
    assert expected <= hit < {("sphere", number) for number in range(1, 64)}


def sphere_centre(number):
    local = avoidance_protocols.unseen(PRIMITIVE).obstacles[0].centre[number - 1]
    return PRIMITIVE.start + baseline_frame() @ local


def test_scenarios_are_chosen_by_name_in_the_order_asked_for():
    chosen = chosen_scenarios(PLACES, ["cylinder/02", "sphere/01"])
    assert {number: place.name for number, place in chosen.items()} == {5: "cylinder/02", 0: "sphere/01"}
    assert list(chosen) == [5, 0]
    with pytest.raises(InputError, match="no 'sphere/3'; names are 'sphere/01' to 'cylinder/02'"):
        chosen_scenarios(PLACES, ["sphere/01", "sphere/3"])


def test_arrows_keep_their_direction_and_are_of_bounded_length():
    coupling = np.array([[0.0, 0.0, 0.0], [0.0, 30.0, -40.0], [0.0, 3e4, -4e4]])
    vectors = drawn.arrow_vectors(coupling)
    np.testing.assert_allclose(vectors[1], drawn.ARROW_SCALE * coupling[1])
    np.testing.assert_allclose(vectors[2], drawn.LONGEST_ARROW_M * np.array([0.0, 0.6, -0.8]))
    np.testing.assert_array_equal(vectors[0], 0.0)


def test_demonstrations_stand_beside_their_obstacle_and_the_baseline(tmp_path, shown):
    path = tmp_path / "demonstrations.rrd"
    places = [(place, place.setting == 1) for place in PLACES[:2]]
    write_avoidance_demonstrations(path, shown, shown[0].demonstrations, PRIMITIVE, places, "Demonstrations")
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    for one in shown:
        tab = f"/{one.scenario.shape}\\/01"
        assert {f"{tab}/obstacle/{part}" for part in ("solid", "cloud")} <= entities
        assert f"{tab}/demonstrated" in entities
        assert rows[f"{tab}/hands/02"] == rows[f"{tab}/distance/02"] == 40
        assert rows[f"{tab}/left\\ of/01"] == rows[f"{tab}/above/01"] == 40
        assert rows[f"{tab}/distance/baseline"] == len(of_baseline(one.reaches).time)
        cloud = values(path, f"{tab}/obstacle/cloud", "Points3D:positions")[0]
        assert one.scenario.obstacle.signed_distance(np.array(cloud)) == pytest.approx(0.0, abs=1e-6)
    assert {"cube/01: 2 demonstrations (simulated)", "what is shown"} <= set(view_names(path))
    assert values(path, "/places", "Points3D:labels") == [["01", "02"]]
    assert "(simulated)" in texts(path, "/notes")[0]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_solid_is_as_large_as_its_obstacle_and_turned_as_far(tmp_path, shown, shape):
    path = tmp_path / "demonstrations.rrd"
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
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    for one in shown:
        tab, reach = f"/{one.scenario.shape}\\/01", one.reaches[1]
        labels = ("this\\ scenario", f"all\\ {one.scenario.shape}s", "all\\ shapes")
        shown_models = [(NETWORK, label) for label in labels] + [("human_inspired", labels[0])]
        for model, label in shown_models:
            scene = f"{tab}/{model}/{label}"
            assert {f"{scene}/path", f"{scene}/coupling"} <= entities
            assert rows[f"{scene}/hand"] == rows[f"{tab}/distance/{model}/{label}"] == len(reach.time)
            assert rows[f"{tab}/terms/{model}/upwards/{label}"] == len(reach.time)
        assert rows[f"{tab}/demonstrated\\ terms/to\\ the\\ left/1"] == 2
        origins = values(path, f"{tab}/network/this\\ scenario/coupling", "Arrows3D:origins")[0]
        np.testing.assert_allclose(origins, reach.position[:: drawn.ARROW_EVERY], atol=1e-6)
        assert "| people |" in texts(path, f"/notes{tab}")[0]
    names = view_names(path)
    assert {"network (simulated)", "human-inspired (simulated)"} <= set(names)
    assert "phase-modulated (simulated)" not in names  # nothing of it was unrolled


def test_every_unseen_sphere_is_a_step_with_its_colour_and_paths(tmp_path, reaches):
    path = tmp_path / "unseen.rrd"
    situation = avoidance_protocols.unseen(PRIMITIVE)
    write_unseen_avoidance(path, situation, reaches, PRIMITIVE, "Unseen")
    rows, entities, timelines = contents(path)
    assert timelines == {"sphere"}
    for name in (*SHAPES, "all"):
        assert rows[f"/one/paths/{name}"] == rows[f"/closest/{name}"] == 63
        assert f"/all/{name}" in entities
    assert rows["/one/sphere"] == rows["/closest/baseline"] == 63
    hit = {number for _, number in hit_settings(reaches, avoidance_protocols.UNSEEN)}
    expected = [VERMILION if number in hit else GREY for number in range(1, 64)]
    colours = values(path, "/one/sphere/cloud", "Points3D:colors")
    assert [f"#{colour[0] >> 8:06x}" for colour in colours] == expected
    tables = texts(path, "/notes/sphere")
    assert [("| hit |" in table.split("\n")[4]) for table in tables] == [
        number in hit for number in range(1, 64)
    ]
    assert f"| baseline | {len(hit)} |" in texts(path, "/notes")[0]
    assert "simulated" in texts(path, "/notes")[0]


def test_situations_that_change_run_on_the_time_line(tmp_path, reaches):
    path = tmp_path / "beyond.rrd"
    situations = [
        avoidance_protocols.moving(PRIMITIVE, PARAMETERS),
        avoidance_protocols.pairs(PRIMITIVE, PARAMETERS),
        avoidance_protocols.goal_change(PRIMITIVE, PARAMETERS),
    ]
    write_changing_avoidance(path, situations, reaches, PRIMITIVE, "Beyond")
    rows, _, timelines = contents(path)
    assert timelines == {"time"}
    names = {
        avoidance_protocols.MOVING: "moving\\ sphere\\ {}\\,\\ 0.1\\ m\\/s",
        avoidance_protocols.PAIR: "two\\ spheres\\ {}",
    }
    for situation in situations:
        groups = [reaches[key] for key in situation_keys(situation)]
        chosen = shown_reaches(groups)
        assert chosen
        assert all(of_baseline(groups[index]).hit for index in chosen)
        name = names.get(situation.protocol, "goal\\ change\\ {}")
        for index in chosen:
            samples = len(groups[index][0].time)
            scene = f"/{situation.protocol}/" + name.format(situation.numbers[index])
            for number in range(len(situation.obstacles)):
                assert rows[f"{scene}/spheres/{number}"] == samples
            assert rows[f"{scene}/reaches/all\\ shapes/trail"] == samples
            assert rows[f"{scene}/goal"] == (2 if situation.goal_change else 1)
        assert "simulated" in texts(path, f"/notes/{situation.protocol}")[0]


def test_chosen_reaches_are_spread_over_those_that_hit(reaches):
    group = reaches[SituationKey(avoidance_protocols.UNSEEN, "sphere", 1)]
    groups = [[replace(group[0], hit=number % 2 == 0)] for number in range(12)]
    assert shown_reaches(groups, 3) == [2, 6, 10]
    assert shown_reaches(groups, 99) == [0, 2, 4, 6, 8, 10]
    assert shown_reaches(groups[1::2]) == []


def test_a_moving_sphere_is_in_the_way_of_the_baseline_just_then():
    situation = avoidance_protocols.moving(PRIMITIVE, PARAMETERS)
    time = PRIMITIVE.unroll(0.04).time
    middle = 31  # of the grid, on the line of the reach
    (path,) = sphere_paths(situation, middle, time, PRIMITIVE)
    nearest = np.linalg.norm(PRIMITIVE.unroll(0.04).position - path, axis=1).min()
    assert nearest < UNSEEN_RADIUS_M
    np.testing.assert_allclose(np.linalg.norm(np.diff(path, axis=0), axis=1), 0.1 * 0.04, rtol=1e-6)
    assert in_base_frame(np.zeros(3), PRIMITIVE) == pytest.approx(PRIMITIVE.start)
