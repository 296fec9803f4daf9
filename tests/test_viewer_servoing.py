"""Recordings of the servoing testbed, of two short simulated demonstrations."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from test_viewer import contents, view_names

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.recordings import read_demonstrations, write_recordings
from structlearn.simulation.touch import FingerParameters, touching
from structlearn.simulation.touch_demonstrator import (
    ToucherParameters,
    demonstrate,
    held_on_handle,
    no_contacts,
    recorded,
    true_contacts,
)
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.flat_maps import map_laying
from structlearn.tactile.touch_dataset import read_dataset, write_dataset
from structlearn.tactile.touch_preparation import TouchDataParameters, prepare
from structlearn.testbeds.servoing.protocol.servo_trials import ServoTrialParameters, make_scene
from structlearn.testbeds.servoing.recordings.demonstrated_touches import (
    handle_place,
    write_touch_demonstrations,
)
from structlearn.testbeds.servoing.recordings.latent_maps import skin_laying, write_latent_maps
from structlearn.testbeds.servoing.recordings.servo_runs import SHOWN, shown_runs, write_servo_runs
from structlearn.testbeds.servoing.recordings.servoing_scene import (
    GRID_LINES,
    electrode_colours,
    flat,
    flat_electrodes,
    skin_lines,
)
from structlearn.testbeds.servoing.recordings.shown_touches import shown_touches

SKIN = SKINS["biotac"]
PERSON = ToucherParameters(areas=1, rotations=1, translations=1, rotation_s=3.0, translation_s=2.0)
PREPARED = TouchDataParameters()
MAP_UNIT_M = 0.01


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Demonstrations, their samples, a latent map that is the skin, and the truth."""
    folder = tmp_path_factory.mktemp("touch")
    runs = list(demonstrate(PERSON, FingerParameters()))
    write_recordings([recorded(one, PERSON) for one in runs], folder / "raw")
    demonstrations = read_demonstrations(folder / "raw", rate_hz=PREPARED.rate_hz)
    write_dataset(prepare(demonstrations, SKIN, PREPARED), folder / "touch.safetensors")
    dataset = read_dataset(folder / "touch.safetensors")
    along, across = SKIN.coordinates(dataset.contact_point.astype(float))
    latent_map = pd.DataFrame(
        {
            "x": across / MAP_UNIT_M,  # turned and mirrored
            "y": along / MAP_UNIT_M,
            "z": dataset.pressure,
            "electrode": dataset.signals.argmin(axis=1) + 1,
            "split": dataset.split,
        }
    )
    truth = pd.concat([true_contacts(one, PERSON) for one in runs], ignore_index=True)
    return demonstrations, dataset, latent_map, truth


@pytest.fixture(scope="module")
def shown(world):
    return shown_touches(*world, ("translation_1_1", "rotation_1_1"), PREPARED.air_s)


@pytest.fixture(scope="module")
def loops():
    """Two trials of each controller: the finger rolls over the handle, and is in the air in the end."""
    scene = make_scene(PERSON, FingerParameters(), ServoTrialParameters())
    time = np.arange(1, 81) / 10
    across = np.linspace(-0.004, 0.004, 80)
    position, orientation = held_on_handle(
        np.full(80, -0.005), across, np.ones(80), scene.handle, scene.finger
    )
    contact = SKIN.surface(np.full(80, -0.005), across)
    table = pd.DataFrame({"time_s": time, "load_n": np.where(time > 7.0, 0.0, 1.0)})
    table[["finger_x_m", "finger_y_m", "finger_z_m"]] = position
    table[["finger_qw", "finger_qx", "finger_qy", "finger_qz"]] = orientation
    table[["x_m", "y_m", "z_m"]] = contact
    table[["latent_x", "latent_y"]] = np.stack([across, np.full(80, -0.005)], axis=1) / MAP_UNIT_M
    table["latent_z"] = 0.0
    table[[f"electrode_{number + 1:02d}" for number in range(19)]] = np.tile(-100.0 * np.arange(19), (80, 1))
    trials, paths = [], []
    for variant in SHOWN.values():
        for trial, motion in enumerate(("rotation", "mixed")):
            keys = vars(variant) | {"seed": 0, "trial": trial}
            paths.append(table.assign(**keys))
            row = keys | {
                "motion": motion,
                "success": trial == 0,
                "position_error_mm": 0.2,
                "pressure_error": 0.1,
            }
            row |= dict(zip(("target_x_m", "target_y_m", "target_z_m"), contact[-1], strict=True))
            row |= {"target_load_n": 1.0, "geodesic_mm": 8.0}
            trials.append(
                row | dict(zip([f"target_latent_{axis}" for axis in "xyz"], (0.4, -0.5, 0.0), strict=True))
            )
    return scene, pd.DataFrame(trials), pd.concat(paths, ignore_index=True)


def write(path, shown):
    write_touch_demonstrations(path, shown, SKIN, 1e-3 * PERSON.handle_radius_mm, "Touch")
    return contents(path)


def positions(path, entity, component):
    """Values of a component that change over time, in the order of time."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and not chunk.is_static and component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return found


def test_shown_touches_are_those_that_were_asked_for(world, shown):
    dataset = world[1]
    assert [one.name for one in shown] == ["translation_1_1", "rotation_1_1"]
    swipe, turn = shown
    assert len(np.unique(swipe.contact)) == 4
    assert len(np.unique(turn.contact)) == 2
    assert len(swipe.time) + len(turn.time) == len(dataset)
    assert abs(swipe.signals[:20].mean()) < 2.0  # counts; in the air the offset is gone
    assert set(swipe.truth["trial"]) == {"translation_1_1"}
    with pytest.raises(InputError, match="there is no 'wipe', only rotation_1_1, translation_1_1"):
        shown_touches(*world, ("wipe",), PREPARED.air_s)


def test_of_recordings_with_other_names_the_first_are_shown(world):
    demonstrations, dataset, latent_map, _ = world
    own = [
        replace(one, name=f"own_{number}", provenance={"origin": "recorded"})
        for number, one in enumerate(demonstrations)
    ]
    wanted = {
        names: shown_touches(own, dataset, latent_map, no_contacts(), names, PREPARED.air_s)
        for names in (("rotation_4_1",), ("own_1",))
    }
    assert [[one.name for one in shown] for shown in wanted.values()] == [["own_0"], ["own_1"]]
    with pytest.raises(InputError, match="there is no 'rotation_4_1', only own_0, own_1"):
        shown_touches(own, dataset, latent_map, no_contacts(), ("own_1", "rotation_4_1"), PREPARED.air_s)


def test_demonstrations_show_finger_electrodes_and_both_contacts(shown, tmp_path):
    path = tmp_path / "demonstrations.rrd"
    rows, entities, timelines = write(path, shown)
    assert timelines == {"time"}
    for one in shown:
        finger, skin = f"/{one.name}/finger", f"/{one.name}/skin"
        assert rows[finger] == -(-len(one.demonstration.time) // 2)  # 50 Hz of 100 Hz
        assert (
            rows[f"{finger}/electrodes"] == rows[f"{skin}/electrodes"] == -(-len(one.demonstration.time) // 4)
        )
        assert {f"{finger}/skin", f"/{one.name}/handle", f"{skin}/estimated", f"{skin}/true"} <= entities
        points = positions(path, f"{skin}/estimated", "Points2D:positions")
        touching = np.isin(np.arange(len(one.demonstration.time))[::4], np.rint(1e2 * one.time).astype(int))
        assert [len(found or []) for found in points] == touching.astype(int).tolist()
    assert "finger on the handle (simulated)" in view_names(path)


def test_of_recorded_touches_no_truth_is_shown(world, tmp_path):
    demonstrations, dataset, latent_map, _ = world
    bags = [replace(one, provenance={"origin": "recorded"}) for one in demonstrations]
    touches = shown_touches(bags, dataset, latent_map, no_contacts(), ("rotation_1_1",), PREPARED.air_s)
    path = tmp_path / "recorded.rrd"
    _, entities, _ = write(path, touches)
    assert "/rotation_1_1/skin/true" not in entities
    assert "finger on the handle" in view_names(path)


def test_handle_is_where_the_finger_rests_on_it(shown):
    for one in shown:
        radius = 1e-3 * PERSON.handle_radius_mm
        centre, axis = handle_place(one, SKIN, radius)
        assert np.linalg.norm(axis) == pytest.approx(1.0)
        rows = np.rint(one.truth["time_s"] / one.demonstration.dt).astype(int)[one.truth["load_n"] > 0.3]
        true = one.truth.loc[one.truth["load_n"] > 0.3, ["x_m", "y_m", "z_m"]].to_numpy(float)
        orientation = one.demonstration.orientation[rows]
        contact = one.demonstration.position[rows] + quaternion.rotate(orientation, true)
        off = contact - centre
        away = np.linalg.norm(off - (off @ axis)[:, None] * axis, axis=1)
        assert np.abs(away - radius).max() < 2.5e-3  # contact points are estimates


def test_latent_paths_lie_on_the_skin_after_the_map_is_turned(world, shown, tmp_path):
    _, dataset, latent_map, _ = world
    path = tmp_path / "latent.rrd"
    write_latent_maps(path, shown, latent_map, dataset.contact_point, SKIN, MAP_UNIT_M, 200, "Latent")
    rows, entities, _ = contents(path)
    assert {"/samples/map", "/samples/skin", "/electrodes/map"} <= entities
    for one in shown:
        for number in np.unique(one.contact):
            on_map, on_skin = (
                positions(path, f"/{one.name}/{part}/{number}/now", "Points2D:positions")
                for part in ("map", "skin")
            )
            np.testing.assert_allclose(on_map, on_skin, atol=1e-3)
            assert rows[f"/{one.name}/map/{number}/trail"] == len(on_map)


def test_laying_undoes_any_turn_mirror_and_shift():
    rng = np.random.default_rng(1)
    places = rng.normal(size=(50, 2))
    angle = 2.1
    turn = np.array([[np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)]])
    points = places @ turn + [3.0, -1.0]
    laying = map_laying(points, places)
    np.testing.assert_allclose(laying(points), places, atol=1e-12)
    np.testing.assert_allclose(laying.turn @ laying.turn.T, np.eye(2), atol=1e-12)


@pytest.mark.parametrize("name", sorted(SKINS))
def test_any_skin_is_drawn_from_its_surface_coordinates(name):
    skin = SKINS[name]
    for line in skin_lines(skin):
        assert np.linalg.norm(line - skin.core(line), axis=1) == pytest.approx(skin.radius)
    assert len(skin_lines(skin)) == 2 * GRID_LINES
    along, across = np.meshgrid(np.linspace(*skin.along, 4)[1:-1], np.linspace(*skin.across, 4)[1:-1])
    places = flat(skin, skin.surface(along, across))
    np.testing.assert_allclose(places, 1e3 * np.stack([along, -across], axis=-1), atol=1e-9)
    assert flat_electrodes(skin).shape == (len(skin.electrodes), 2)
    assert len(electrode_colours(len(skin.electrodes), 1.0)) == len(skin.electrodes)


def test_closed_loops_stand_beside_each_other(world, loops, tmp_path):
    _, dataset, latent_map, _ = world
    scene, trials, paths = loops
    runs = shown_runs(trials, paths, 5)
    assert [list(one) for one in runs] == [["as published", "resting"]] * 2
    assert runs[1]["resting"].trial["motion"] == "mixed"
    path = tmp_path / "servo.rrd"
    laying = skin_laying(latent_map, dataset.contact_point, SKIN, MAP_UNIT_M)
    write_servo_runs(path, runs, scene, laying, MAP_UNIT_M, "Loops")
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    for name in ("1\\,\\ rotation", "2\\,\\ mixed"):
        for label in ("as\\ published", "resting"):
            assert rows[f"/{name}/{label}/finger"] == 80
            latent, contact = (
                positions(path, f"/{name}/{label}/map/{kind}/now", "Points2D:positions")
                for kind in ("latent", "contact")
            )
            assert len(contact) == 70  # then the finger is in the air
            np.testing.assert_allclose(latent[:70], contact, atol=1e-2)
    assert {"NJ as published (simulated)", "NJ resting (simulated)"} <= set(view_names(path))
    assert "/handle" in entities


def test_handle_of_closed_loops_touches_the_finger(loops):
    scene, _, paths = loops
    contact = touching(
        paths[["finger_x_m", "finger_y_m", "finger_z_m"]].to_numpy(),
        paths[["finger_qw", "finger_qx", "finger_qy", "finger_qz"]].to_numpy(),
        scene.handle,
        scene.finger,
    )
    np.testing.assert_allclose(contact.point, paths[["x_m", "y_m", "z_m"]], atol=1e-6)
