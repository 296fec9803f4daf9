"""Recordings of the servoing testbed, of two short simulated demonstrations."""

import numpy as np
import pandas as pd
import pytest
from committed import committed, committed_finger
from viewer_files import colour_of, contents, note, values, view_names

from dissertation.servoing.names import AS_PUBLISHED, FORM_COLOURS, FORM_NAMES, OURS
from dissertation.servoing.protocol.servo_trials import make_scene
from dissertation.servoing.protocol.servo_variants import ServoTrialParameters
from dissertation.servoing.recordings import demonstrated_touches as touches
from dissertation.servoing.recordings.servo_runs import servo_runs, shown_runs
from dissertation.servoing.recordings.servoing_scene import FlatSkin
from dissertation.simulation.touch_demonstrator import (
    ToucherParameters,
    demonstrate,
    held_on_handle,
    recorded,
    true_contacts,
)
from structlearn.readers import synchronise
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.touch_dataset import TouchDataParameters, prepare, read_dataset, write_dataset
from structlearn.viewer.items import entity
from structlearn.viewer.recording import write

SKIN = SKINS["biotac"]
PERSON = committed(ToucherParameters, "toucher", areas=1, rotations=1, translations=1, durations_s=(3.0, 2.0))
PREPARED = committed(TouchDataParameters, "touch_dataset")
MAP_UNIT_M = 0.01


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Demonstrations, their samples, a latent map that is the skin, and the truth."""
    folder = tmp_path_factory.mktemp("touch")
    runs = list(demonstrate(PERSON, committed_finger()))
    demonstrations = [synchronise(recorded(one, PERSON), PREPARED.rate_hz) for one in runs]
    write_dataset(prepare(demonstrations, SKIN, PREPARED), folder / "touch.safetensors")
    dataset = read_dataset(folder / "touch.safetensors")
    along, across = SKIN.coordinates(dataset.contact_point.astype(float))
    turned = {"x": across / MAP_UNIT_M, "y": along / MAP_UNIT_M}  # and mirrored
    electrode = dataset.signals.argmin(axis=1) + 1
    latent_map = pd.DataFrame(turned | {"z": dataset.pressure, "electrode": electrode})
    truth = pd.concat([true_contacts(one, PERSON) for one in runs], ignore_index=True)
    return demonstrations, dataset, latent_map, truth


@pytest.fixture(scope="module")
def shown(world):
    return touches.shown_touches(*world, ("translation_1_1", "rotation_1_1"), PREPARED.air_s)


@pytest.fixture(scope="module")
def laid(world):
    _, dataset, latent_map, _ = world
    return FlatSkin.fitted(SKIN, dataset.contact_point, latent_map[["x", "y"]].to_numpy(float), MAP_UNIT_M)


@pytest.fixture(scope="module")
def loops():
    """Two trials of each controller: the finger rolls over the handle, and is in the air in the end."""
    scene = make_scene(PERSON, committed_finger(), committed(ServoTrialParameters, "servo"))
    time, along, across = np.arange(1, 81) / 10, np.full(80, -0.005), np.linspace(-0.004, 0.004, 80)
    position, orientation = held_on_handle(along, across, np.ones(80), scene.handle, scene.finger)
    contact = SKIN.surface(along, across)
    table = pd.DataFrame({"time_s": time, "load_n": np.where(time > 7.0, 0.0, 1.0), "latent_z": 0.0})
    table[["finger_x_m", "finger_y_m", "finger_z_m"]] = position
    table[["finger_qw", "finger_qx", "finger_qy", "finger_qz"]] = orientation
    table[["x_m", "y_m", "z_m"]] = contact
    table[["latent_x", "latent_y"]] = np.stack([across, along], axis=1) / MAP_UNIT_M
    table[[f"electrode_{number + 1:02d}" for number in range(19)]] = -100.0 * np.arange(19)
    trials, paths = [], []
    for variant in (AS_PUBLISHED, OURS):
        for trial, motion in enumerate(("rotation", "mixed")):
            keys = vars(variant) | {"seed": 0, "trial": trial}
            paths.append(table.assign(**keys))
            ends = dict(zip(("target_x_m", "target_y_m", "target_z_m"), contact[-1], strict=True))
            ends |= {"target_latent_x": 0.4, "target_latent_y": -0.5, "target_latent_z": 0.0}
            ends |= {"position_error_mm": 0.2, "pressure_error": 0.1, "target_load_n": 1.0}
            trials.append(keys | ends | {"motion": motion, "success": trial == 0, "geodesic_mm": 8.0})
    return scene.handle, pd.DataFrame(trials), pd.concat(paths, ignore_index=True)


def now(path, scene, places):
    """Points where a touch is, in the order of time, at each of several places of a scene."""
    return [values(path, f"{scene}/{place}/now", "Points2D:positions") for place in places]


def test_demonstrations_show_finger_electrodes_and_both_contacts(shown, tmp_path):
    path = tmp_path / "demonstrations.rrd"
    write(path, touches.demonstrations(shown, SKIN, 1e-3 * PERSON.handle_radius_mm))
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    for one in shown:
        finger, skin, count = f"/{one.name}/finger", f"/{one.name}/skin", len(one.motion.time)
        assert rows[finger] == -(-count // 2)  # 50 Hz of 100 Hz
        assert rows[f"{finger}/electrodes"] == rows[f"{skin}/electrodes"] == -(-count // 4)
        assert {f"{finger}/skin", f"/{one.name}/handle", f"{skin}/estimated", f"{skin}/true"} <= entities
        points = values(path, f"{skin}/estimated", "Points2D:positions")
        touching = np.isin(np.arange(count)[::4], one.rows)
        assert [len(found or []) for found in points] == touching.astype(int).tolist()
        assert "(simulated)" in note(path, f"/notes/{one.name}")
    assert "finger on the handle (simulated)" in view_names(path)


def test_latent_paths_lie_on_the_skin_after_the_map_is_turned(world, shown, laid, tmp_path):
    _, dataset, latent_map, _ = world
    path = tmp_path / "latent.rrd"
    write(path, touches.latent_maps(shown, laid, latent_map, dataset.contact_point, 200))
    rows, entities, _ = contents(path)
    assert {"/samples/map", "/samples/skin", "/electrodes/map"} <= entities
    for one in shown:
        assert "(simulated)" in note(path, f"/notes/{one.name}")
        for number in np.unique(one.contact):
            on_map, on_skin = now(path, f"/{one.name}", (f"map/{number}", f"skin/{number}"))
            np.testing.assert_allclose(on_map, on_skin, atol=1e-3)
            assert rows[f"/{one.name}/map/{number}/trail"] == len(on_map)


def test_closed_loops_stand_beside_each_other_with_the_names_and_colours_of_the_page(laid, loops, tmp_path):
    handle, trials, paths = loops
    runs = shown_runs(trials, paths, 5)
    labels = list(FORM_NAMES.values())
    assert [list(one) for one in runs] == [labels] * 2
    path = tmp_path / "servo.rrd"
    write(path, servo_runs(runs, laid, handle))
    rows, entities, timelines = contents(path)
    assert timelines == {"time"}
    for name in ("1, rotation", "2, mixed"):
        for form, label in FORM_NAMES.items():
            place = entity(name, label)
            assert rows[f"{place}/finger"] == 80
            latent, contact = now(path, f"{place}/map", ("latent", "contact"))
            assert len(contact) == 70  # then the finger is in the air
            np.testing.assert_allclose(latent[:70], contact, atol=1e-2)
            assert colour_of(path, entity(name, "load", label)) == FORM_COLOURS[form]
        assert all(label in note(path, entity("notes", name)) for label in labels)
        assert "simulated" in note(path, entity("notes", name))
    assert {f"NJ, {label} (simulated)" for label in labels} <= set(view_names(path))
    assert "/handle" in entities
