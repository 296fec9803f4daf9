"""Runs of the testbed as recordings: complete, labelled, repeatable one by one."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from scraping_motions import DURATIONS_S, NAMES, constant_network, scraping_skill

from dissertation.scraping.protocol.executions import (
    evaluation_runs,
    executions,
    nominal_runs,
    runs_to_correct,
)
from dissertation.scraping.world import testbed
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from structlearn.core import quaternion
from structlearn.readers import synchronise
from structlearn.readers.clock import check_recording

KINDS = ["pose", "joint_positions", "joint_velocities", "joint_torques", "wrench"]
KINDS += ["tactile", "tactile", "tool_to_board"]
TESTBED = committed(testbed.TestbedParameters, "testbed")


@pytest.fixture(scope="module")
def skill():
    return scraping_skill()


@pytest.fixture(scope="module")
def runs():
    return [*nominal_runs(1), *runs_to_correct([5.0], 2), *evaluation_runs([8.8], 1, feedback=False)]


@pytest.fixture(scope="module")
def recordings(skill, runs):
    return executions(skill, runs, TESTBED)


def same(first, second):
    return first.name == second.name and all(
        np.array_equal(one.stamps, two.stamps) and np.array_equal(one.values, two.values)
        for one, two in zip(first.streams, second.streams, strict=True)
    )


def stream(recording, kind):
    return next(one for one in recording.streams if one.kind == kind)


def test_readers_are_sound_and_have_all_streams(recordings):
    assert len(recordings) == 4
    for recording in recordings:
        check_recording(recording)
        assert [one.kind for one in recording.streams] == KINDS
        widths = [one.values.shape[1] for one in recording.streams]
        assert widths == [7, 7, 7, 7, 6, 19, 19, 4]
        pose = recording.streams[0]
        assert np.median(np.diff(pose.stamps)) == pytest.approx(1e9 / 300, abs=1)
        for one in recording.streams[5:]:
            assert np.median(np.diff(one.stamps)) * 1e-9 == pytest.approx(0.01, abs=5e-4)


def test_what_is_simulated_says_so(recordings, runs):
    settings = ["0", "5", "5", "8.8"]
    kinds = ["nominal", "corrected by a person", "corrected by a person", "nominal"]
    for recording, run, setting, kind in zip(recordings, runs, settings, kinds, strict=True):
        assert recording.name == run.name
        assert recording.provenance["origin"] == "simulated"
        assert recording.provenance["setting"] == f"board roll {setting} degrees"
        assert recording.provenance["what"] == f"execution, {kind}"
        assert recording.provenance["seed"] == " ".join(map(str, [TESTBED.seed, *run.seed]))
        assert all(isinstance(value, str) for value in recording.provenance.values())


def test_true_segments_are_the_commanded_primitives(recordings):
    for recording in recordings:
        segments = recording.true_segments
        assert segments.shape == (3, 2)
        np.testing.assert_array_equal(segments[1:, 0], segments[:-1, 1])
        np.testing.assert_allclose(np.diff(segments)[:, 0], DURATIONS_S, atol=1.01 / 300)
        assert segments[0, 0] == 0.0
        assert segments[-1, 1] == pytest.approx(sum(DURATIONS_S))


def test_runs_with_and_without_feedback_meet_equal_conditions():
    without, with_it = (evaluation_runs([0.0, 8.8], 3, feedback) for feedback in (False, True))
    assert [replace(run, feedback=True) for run in without] == with_it
    assert [run.name for run in without] == ["01", "02", "03"] * 2
    assert [run.setting_deg for run in without] == [0.0] * 3 + [8.8] * 3


def test_feedback_that_asks_for_nothing_is_the_nominal_run(recordings, runs):
    """Equal conditions to the last bit: what differs between two runs is what the networks do."""
    silent = scraping_skill({name: constant_network(0.0) for name in NAMES[1:]})
    (found,) = executions(silent, [replace(runs[3], feedback=True)], TESTBED)
    assert found.provenance["what"] == "execution, with feedback"
    for one, other in zip(found.streams, recordings[3].streams, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


def test_motion_capture_has_its_own_noise(skill):
    seen = []
    for noise_deg in (0.5, 0.0):
        recorder = committed(testbed.RecorderParameters, "testbed.recorder", motion_capture_deg=noise_deg)
        (recording,) = executions(skill, nominal_runs(1), TESTBED.model_copy(update={"recorder": recorder}))
        seen.append(stream(recording, "tool_to_board").values)
    off = np.degrees(quaternion.difference(*seen))
    np.testing.assert_allclose(off.std(axis=0), 0.5, rtol=0.2)
    np.testing.assert_allclose(np.linalg.norm(seen[0], axis=1), 1.0)


def test_a_person_and_fingers_have_constants_of_their_own_seeds():
    one, other, fingers = (
        testbed.drawn_testbed(TESTBED.model_copy(update=seeds))
        for seeds in ({}, {"seed": 5}, {"sensor_seed": 5})
    )
    for part, same_as_one, differs in (("corrector", fingers, other), ("touch", other, fingers)):
        mine, population = getattr(one, part), getattr(TESTBED, part)
        assert getattr(same_as_one, part) == mine
        for name in population.between:
            assert len({getattr(its, name) for its in (mine, population, getattr(differs, part))}) == 3
        constants = set(type(mine).model_fields) - {*population.between, "between"}
        assert all(getattr(mine, name) == getattr(population, name) for name in constants)
    its = one.corrector
    assert its.damping_n_m_s_rad == TESTBED.corrector.damping_s * its.stiffness_n_m_rad
    assert testbed.drawn_testbed(one) == one


def test_a_guided_demonstration_is_recorded_like_an_execution():
    quick = {"durations_s": (0.6, 0.6, 0.6), "rest_s": (0.2, 0.2), "pause_s": (0.1, 0.1)}
    demonstrator = committed(DemonstratorParameters, "simulate", count=2, seed=3, **quick)
    both = testbed.guided_demonstrations(demonstrator, TESTBED.guidance, TESTBED)
    assert [recording.name for recording in both] == ["01", "02"]
    for recording in both:
        check_recording(recording)
        assert [one.kind for one in recording.streams] == KINDS
        assert recording.provenance["what"] == "a person guides the arm"
        np.testing.assert_array_equal(recording.true_segments[1:, 0], recording.true_segments[:-1, 1])
        assert recording.true_segments[-1, 1] < synchronise(recording).time[-1]
    assert not np.array_equal(both[0].true_segments, both[1].true_segments)
    alone = demonstrator.model_copy(update={"count": 1})
    (first,) = testbed.guided_demonstrations(alone, TESTBED.guidance, TESTBED)
    assert same(first, both[0])
