"""A finger on a handle: contact against other ways to find it, kinematics, counts, demonstrations."""

import numpy as np
import pytest
from committed import committed, committed_finger
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import binary_closing
from scipy.optimize import minimize_scalar

from dissertation.simulation.touch import Handle, make_finger, moved, rested, touch, touching
from dissertation.simulation.touch_demonstrator import (
    ToucherParameters,
    demonstrate,
    held_on_handle,
    person_with_sensor,
    recorded,
)
from structlearn.core import quaternion
from structlearn.readers.clock import check_recording
from structlearn.tactile.electrodes import SKINS, biotac
from structlearn.tactile.touch_dataset import contact_points

RATE_HZ = 100.0
BAR = Handle(np.array([0.3, 0.1, 0.5]), np.array([0.0, 1.0, 0.0]), 0.05, 0.005)
FINGER = make_finger(committed_finger(), biotac(), 1, RATE_HZ)


def handle(axis: np.ndarray, half_length: float = 0.05) -> Handle:
    return Handle(BAR.centre, axis / np.linalg.norm(axis), half_length, BAR.radius)


@given(st.integers(0, 10_000), st.sampled_from(sorted(SKINS)))
def test_contact_is_where_bar_and_core_are_closest(seed, name):
    """Against a bounded scalar minimiser."""
    rng = np.random.default_rng(seed)
    bar = handle(rng.normal(size=3))
    finger = make_finger(committed_finger(), SKINS[name], 1, RATE_HZ)
    position = bar.centre + 0.02 * rng.normal(size=(1, 3))
    orientation = quaternion.normalised(rng.normal(size=(1, 4)))
    found = touching(position, orientation, bar, finger)

    def distance(place):
        in_finger = quaternion.rotate(
            quaternion.conjugate(orientation[0]), bar.centre + place * bar.axis - position[0]
        )
        return np.linalg.norm(in_finger - finger.skin.core(in_finger))

    best = minimize_scalar(distance, bounds=(-0.05, 0.05), method="bounded", options={"xatol": 1e-9})
    away = found.gap[0] + finger.skin.radius + bar.radius
    assert away <= best.fun + 1e-9
    assert away == pytest.approx(min(best.fun, distance(-0.05), distance(0.05)), abs=1e-6)


@given(st.floats(-0.012, 0.006), st.floats(-0.007, 0.007), st.floats(0.05, 3.0), st.floats(-0.3, 0.3))
def test_a_held_finger_touches_where_and_as_hard_as_asked(along, across, load, pitch):
    args = (np.array([along]), np.array([across]), np.array([load]))
    bar = handle(np.array([-0.3, 0.9, 0.0]))
    contact = touching(*held_on_handle(*args, bar, FINGER, (pitch, 0.0)), bar, FINGER)
    assert contact.load[0] == pytest.approx(load, rel=1e-6)
    if along <= 0:  # on the cylinder any pitch about the handle keeps the place
        np.testing.assert_allclose(contact.point[0], FINGER.skin.surface(along, across), atol=1e-7)


def test_a_motion_is_in_the_frame_of_the_finger():
    orientation = quaternion.from_rotation_vector(np.array([[0, 0, np.pi / 2]]))
    position, turned = moved(np.zeros((1, 3)), orientation, np.array([[1.0, 0, 0, 0, 0, 0.1]]), 0.5)
    np.testing.assert_allclose(position, [[0, 0.5, 0]], atol=1e-12)
    np.testing.assert_allclose(quaternion.rotation_vector(turned), [[0, 0, np.pi / 2 + 0.05]], atol=1e-12)


def test_a_batch_is_what_its_fingers_are_alone_and_steps_are_what_the_trace_is():
    rng = np.random.default_rng(0)
    load = np.abs(rng.normal(size=(50, 4)))
    point = FINGER.skin.surface(rng.uniform(-0.01, 0.004, (50, 4)), rng.uniform(-0.006, 0.006, (50, 4)))
    start = rested(4, FINGER)
    whole, after = touch(load, point, FINGER, start)
    assert (start.lag == 0).all()  # what was given is not changed
    alone, _ = touch(load[:, 2:3], point[:, 2:3], FINGER, rested(1, FINGER))
    np.testing.assert_array_equal(whole[:, 2], alone[:, 0])
    memory = rested(4, FINGER)
    for t in range(50):
        step, memory = touch(load[t : t + 1], point[t : t + 1], FINGER, memory)
        np.testing.assert_array_equal(step[0], whole[t])
    np.testing.assert_array_equal(memory.lag, after.lag)


@pytest.mark.parametrize("name", ["biotac", "flat_pad"])
def test_pressure_rises_with_load_all_over_the_skin(name):
    skin = SKINS[name]
    finger = make_finger(committed_finger(), skin, 1, RATE_HZ)
    along, across = np.meshgrid(np.linspace(-0.0125, 0.001, 9), 0.7 * np.linspace(*skin.across, 9))
    point = np.tile(skin.surface(along.ravel(), across.ravel()), (200, 1, 1))
    pressure = []
    for load in (0.3, 0.6, 1.2, 2.4):
        signal, _ = touch(np.full(point.shape[:2], load), point, finger, rested(81, finger))
        pressure.append(-(signal[-1] - finger.response.offset[0]).mean(axis=1))
    assert (pressure[0] > 0).all()
    assert (np.diff(pressure, axis=0) > 0).all()


@pytest.fixture(scope="module")
def person():
    return committed(ToucherParameters, "toucher", areas=2, rotations=1, translations=1)


@pytest.fixture(scope="module")
def runs(person):
    return list(demonstrate(person, committed_finger()))


def test_demonstrations_make_and_break_contact_and_cover_their_areas(runs):
    kinds = ("rotation", "translation")
    assert [run.name for run in runs] == [f"{kind}_{area}_1" for kind in kinds for area in (1, 2)]
    for run in runs:
        touched = run.load > 0.2
        held = binary_closing(touched, iterations=20)  # a light touch may slacken for a moment
        contacts = (np.diff(held.astype(int)) == 1).sum()
        assert contacts == {"rotation": 2, "translation": 4}[run.motion]
        assert run.load[:25].max() == 0  # in the air first
        along, across = biotac().coordinates(run.contact_point[touched])
        moves, stays = (across, along) if run.motion == "rotation" else (along, across)
        assert np.ptp(moves) > 3 * np.ptp(stays)
        assert biotac().holds(run.contact_point[touched]).all()


def test_the_estimated_contact_is_near_the_true_one(runs):
    errors = []
    for run in runs:
        touched = run.load > 0.3
        estimate = contact_points((run.counts - run.counts[:25].mean(axis=0))[touched], biotac())
        errors.append(np.linalg.norm(estimate - run.contact_point[touched], axis=1))
    assert np.median(np.concatenate(errors)) < 1.2e-3


def test_readers_are_valid(runs, person):
    for first in runs:
        one = recorded(first, person)
        check_recording(one)
        assert one.provenance["motion"] == first.motion
        assert one.provenance["origin"] == "simulated"
        assert len(one.streams[0].stamps) == pytest.approx(3 * len(one.streams[1].stamps), abs=3)


def test_people_press_and_move_as_was_drawn_for_them_and_sensors_take_what_differs_in_electrodes():
    people = committed(ToucherParameters, "toucher", areas=1, rotations=0, translations=1, time_cv=0.0)
    assert set(committed_finger().between) >= {"width_mm", "stiffness_n_mm"}
    pressed = []
    for seed in range(8):
        seeds = {"seed": seed, "sensor_seed": seed + 1}
        person, finger = person_with_sensor(people.model_copy(update=seeds), committed_finger())
        assert finger.width_mm != committed_finger().width_mm
        light, firm = person.load_n
        assert firm / light == pytest.approx(people.load_n[1] / people.load_n[0])
        assert person.durations_s[0] / person.durations_s[1] == pytest.approx(6.6 / 2.5)
        (run,) = demonstrate(person, finger)
        pressed.append(np.quantile(run.load[run.load > 0], 0.9) / firm)
        assert (run.load > 0).sum() / RATE_HZ == pytest.approx(4 * person.durations_s[1], rel=0.15)
    assert max(pressed) < 1.6
