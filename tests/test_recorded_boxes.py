"""Reaches past boxes: cutting, folds, learning and unrolling, on made-up trials and on recorded ones."""

import runpy
import shutil
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from committed import committed
from readers_bags import recorded_data

from structlearn.avoidance import scene_folds, scene_models
from structlearn.avoidance.features import features
from structlearn.avoidance.scene_models import displaced_states, samples_of_scene, scene_states
from structlearn.avoidance.scene_people import (
    ScenePeopleParameters,
    folds_of_people,
    reaches_past_obstacles,
)
from structlearn.avoidance.scene_unroll import nearest_seen, unroll_through
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.minimum_jerk import progress
from structlearn.primitives.position import fit_position
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.reaches_past_boxes import read_reaches_past_boxes
from structlearn.readers.recording import NamedShape
from structlearn.tasks.public.public_files import RecordedFiles

PARAMETERS = committed(
    ScenePeopleParameters,
    "recorded_boxes",
    tuned_on=["p0"],
    folds=2,
    network={"members": 1, "training": {"iterations": 4}},
    text_network={"training": {"iterations": 4}},
)
RATE_HZ, REST_S, MOVE_S = 90.0, 0.6, 1.5
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
WALLS = [
    NamedShape(f"boundary {side}", "cube", np.array([x, -0.05, 0.8]), UPRIGHT, np.array([0.02, 0.6, 0.13]))
    for side, x in (("left", -0.36), ("right", 0.36))
]


def made_up_trial(person, number, bow=0.0, x=0.0, move_s=MOVE_S, late_s=0.2):
    """A hand that rests, reaches 0.4 m forward with a bow of so many m to the right, and rests."""
    time = np.arange(0.0, move_s + 2 * REST_S, 1.0 / RATE_HZ)
    share = progress(np.clip((time - REST_S) / move_s, 0.0, 1.0))
    side = 0.03 * number + bow * np.sin(np.pi * share)
    position = np.column_stack([side, -0.25 + 0.4 * share, 0.78 + 0.02 * np.sin(np.pi * share)])
    box = NamedShape("box A", "cube", np.array([x, -0.05, 0.79]), UPRIGHT, np.array([0.1, 0.05, 0.12]))
    known = {"person": person, "moved_s": f"{REST_S + late_s}", "reached_s": f"{REST_S + move_s}"}
    known["origin"] = "recorded"
    return Demonstration(f"{person}_{number}", time, position, provenance=known, shapes=(box, *WALLS))


@lru_cache
def made_up_reaches():
    """Three people, each with a blocked reach, a free one and another blocked one."""
    trials = []
    for place in range(3):
        bow = 0.12 + 0.01 * place
        trials += [
            made_up_trial(f"p{place}", 0, bow),
            made_up_trial(f"p{place}", 1, 0.01, x=-0.2),
            made_up_trial(f"p{place}", 2, -bow, x=0.08),
        ]
    return reaches_past_obstacles(trials, PARAMETERS)


@lru_cache
def made_up_results():
    reaches, left_out = made_up_reaches()
    folds = folds_of_people(reaches, PARAMETERS)
    return scene_folds.judge_folds(reaches, left_out, folds, PARAMETERS)


def test_a_reach_begins_at_its_onset_and_ends_at_the_target():
    (reach,), left_out = reaches_past_obstacles([made_up_trial("p1", 0, 0.1)], PARAMETERS)
    assert left_out.empty
    speed = np.gradient(progress(np.linspace(0.0, 1.0, 2001)))
    begins = MOVE_S * np.argmax(speed > PARAMETERS.reaches.onset_share * speed.max()) / 2000
    assert reach.duration_s == pytest.approx(MOVE_S - begins, abs=0.04)
    assert np.allclose(reach.in_base_frame[-1], [0.0, 0.15, 0.78], atol=2e-3)
    assert np.allclose(reach.path.position[0], 0.0)
    assert np.allclose(reach.goal[1:], 0.0)  # x points to the goal
    assert (len(reach.obstacles), len(reach.walls)) == (1, 2)
    peak = np.abs(reach.path.velocity).max()
    assert (
        np.abs(np.gradient(reach.path.position, reach.path.time, axis=0) - reach.path.velocity).max()
        < 0.1 * peak
    )


def test_jumps_and_long_reaches_are_left_out_with_their_reason():
    long = made_up_trial("p1", 1, move_s=6.0, late_s=2.0)
    jumping = made_up_trial("p2", 2)
    position = jumping.position.copy()
    position[100] += 0.2
    reaches, left_out = reaches_past_obstacles([long, replace(jumping, position=position)], PARAMETERS)
    assert reaches == []
    assert left_out["trial"].tolist() == ["p1_1", "p2_2"]
    assert left_out["reason"][0].startswith("takes 5.")
    assert left_out["reason"][1].startswith("tracking jumps, 31")


def test_times_that_are_not_of_the_recording_make_no_reach():
    trial = made_up_trial("p1", 0)
    late = replace(trial, provenance=trial.provenance | {"moved_s": "100", "reached_s": "101"})
    reaches, left_out = reaches_past_obstacles([late], PARAMETERS)
    assert (reaches, left_out["reason"].tolist()) == ([], ["does not move before it ends"])


def test_a_recording_that_begins_late_begins_with_its_slowest_sample():
    trial = made_up_trial("p1", 0)
    first = int((REST_S + 0.15 * MOVE_S) * RATE_HZ)
    known = trial.provenance | {
        key: f"{float(trial.provenance[key]) - trial.time[first] + 0.1}" for key in ("moved_s", "reached_s")
    }
    late = replace(
        trial, time=trial.time[first:] - trial.time[first], position=trial.position[first:], provenance=known
    )
    (reach,), _ = reaches_past_obstacles([late], PARAMETERS)
    assert reach.in_base_frame[0] == pytest.approx(late.position[0], abs=2e-3)


def test_trials_must_say_whose_they_are_and_have_obstacles():
    trial = made_up_trial("p1", 0)
    with pytest.raises(InputError, match="p1_0: has no obstacles, nor have the others; name"):
        reaches_past_obstacles([replace(trial, shapes=WALLS)], PARAMETERS)
    with pytest.raises(InputError, match="p1_0: its provenance does not say whose"):
        reaches_past_obstacles([replace(trial, provenance={})], PARAMETERS)
    reaches, left_out = reaches_past_obstacles([trial, replace(trial, name="free", shapes=())], PARAMETERS)
    assert [reach.name for reach in reaches] == ["p1_0"]
    assert left_out[["trial", "reason"]].to_numpy().tolist() == [["free", "has no obstacles"]]


def test_a_reach_of_which_no_times_are_known_is_the_motion_between_rests():
    trial = made_up_trial("p1", 0, 0.1)
    (reach,), _ = reaches_past_obstacles([replace(trial, provenance={"person": "p1"})], PARAMETERS)
    assert reach.duration_s == pytest.approx(MOVE_S, abs=0.2)
    assert reach.in_base_frame[[0, -1]] == pytest.approx(trial.position[[0, -1]], abs=5e-3)


def test_nobody_is_judged_by_what_was_learned_from_them():
    results = made_up_results()
    assert set(results.reaches["person"]) == {"p1", "p2"}  # p0 is only learned from
    assert results.reaches.groupby("person")["fold"].nunique().eq(1).all()
    assert results.reaches.groupby("way").size().eq(6).all()
    assert set(results.reaches["way"]) == set(scene_folds.WAYS)


def test_few_people_are_left_out_one_at_a_time():
    reaches, _ = made_up_reaches()
    more = PARAMETERS.model_copy(update={"folds": 3})
    assert folds_of_people(reaches, more) == [["p1"], ["p2"]]
    assert folds_of_people(reaches[:6], more) == [["p1"]]  # p0 is learned from
    assert folds_of_people(reaches[3:], more) == [["p1"], ["p2"]]
    anybody = more.model_copy(update={"tuned_on": ()})  # dealt out by how straight they reach
    assert folds_of_people(reaches, anybody) == [["p0"], ["p1"], ["p2"]]
    for few in (reaches[:3], reaches[3:6]):
        with pytest.raises(MissingInputError, match=r"reaches of 1 people, \d of them on whom nothing"):
            folds_of_people(few, more)


def test_scores_tell_blocked_from_free_and_the_sides():
    rows = made_up_results().reaches.set_index(["way", "reach"])
    none = rows.loc["none"]
    assert none["blocked"].tolist() == [True, False, True] * 2
    assert none["hit"].tolist() == [True, False, True] * 2
    assert none["clearance_mm"].to_numpy()[[1, 4]].min() > 100
    planned = rows.loc["planned"]
    assert not planned["hit"].any()
    assert planned["left_mm"].max() < 1e-6
    assert planned.loc["p1_1", "same_gaps"]
    assert rows.loc["scene", "left_mm"].max() < 1e3 * PARAMETERS.end_limit_m + 5.0


def test_a_person_is_the_same_as_themselves():
    reaches, _ = made_up_reaches()
    own = np.array([reach.in_base_frame for reach in reaches])
    rows = scene_folds.scores(reaches, own, np.zeros(len(own)), PARAMETERS.hand_radius_m)
    assert rows["same_gaps"].all()
    assert rows["path_mm"].max() == 0.0
    pairs = scene_folds.beside_each_other(reaches)
    assert len(pairs) == 9  # three scenes, three pairs of people
    assert pairs["path_mm"].max() < 30.0
    assert pairs["same_gaps"].all()


def test_the_text_sees_the_nearest_box():
    reaches, _ = made_up_reaches()
    scenes = scene_models.reach_scenes(reaches, PARAMETERS)
    rng = np.random.default_rng(0)
    position, velocity = rng.normal(0.1, 0.1, (2, len(reaches), 3))
    clouds = np.stack([scenes.clouds[:, 0] + [0.0, 0.5, 0.0], scenes.clouds[:, 0]], axis=1)
    seen = nearest_seen(position, velocity, clouds)
    near = clouds[:, 1]
    expected = features(position, velocity, 1.0, near, near.mean(axis=1))
    assert np.allclose(seen.features, expected)
    assert np.allclose(seen.first_x, near[..., 0].min(axis=1))


def test_without_feedback_it_is_the_primitive_and_with_its_target_the_demonstration():
    reaches, _ = made_up_reaches()
    baseline = scene_models.straight_baseline(reaches, PARAMETERS.straight_share)
    goals, samples = np.array([reach.goal for reach in reaches]), PARAMETERS.reaches.samples
    alone = unroll_through(baseline, goals, None, samples)
    one = baseline.unroll(1.0 / (samples - 1), start=np.zeros(3), goal=goals[0], duration=1.0)
    assert np.allclose(alone.position[0], one.position)
    states = scene_states([reach.path for reach in reaches], baseline, 1)
    target = states.target.reshape(len(reaches), samples, 3)
    shown = unroll_through(baseline, goals, lambda k, x, v: target[:, k], samples)
    own = np.array([reach.path.position for reach in reaches])
    assert np.abs(shown.position - own).max() < 0.015  # of 0.12; it begins as the baseline's reaches did
    assert np.abs(alone.position - own).max() > 0.1
    pushed = unroll_through(baseline, goals, lambda k, x, v: np.full(x.shape, 40.0), samples, 0.02, 20.0)
    left = np.linalg.norm(pushed.position[:, -1] - alone.position[:, -1], axis=1)
    assert left.max() < 0.02 + 1e-9
    assert np.abs(pushed.position - alone.position).max() > 0.05


def test_where_no_reach_is_straight_the_straightest_is_the_baseline():
    reaches, _ = made_up_reaches()
    bent = [reach for reach in reaches if reach.name.endswith("_0")]
    alone = scene_models.straight_baseline(bent[:1], PARAMETERS.straight_share)  # its bow is the smallest
    both = scene_models.straight_baseline(bent, PARAMETERS.straight_share)
    assert np.array_equal(alone.unroll(0.01, duration=1.0).position, both.unroll(0.01, duration=1.0).position)


def test_states_elsewhere_lead_back():
    reaches, _ = made_up_reaches()
    baseline = fit_position([reach.path for reach in reaches]).local
    states = scene_states([reach.path for reach in reaches], baseline, 10)
    beside = displaced_states(states, PARAMETERS.network, 60.0, (0, 0))
    count = len(states.time)
    assert len(beside.time) == 2 * count
    assert np.array_equal(beside.position[:count], states.position)
    off = beside.position[count:] - states.position
    assert np.allclose(beside.target[count:], states.target - 60.0 * off)
    assert 0.5 < off.std() / PARAMETERS.network.displaced_m < 1.5
    few = PARAMETERS.network.model_copy(update={"demonstrations": 2})
    assert len(np.unique(displaced_states(states, few, 60.0, (0, 0)).scene)) == 2
    scenes = scene_models.reach_scenes(reaches, PARAMETERS)
    dataset = samples_of_scene(states, scenes, PARAMETERS.look_ahead.ahead_m)
    one = states.where(states.scene == 4)
    alone = samples_of_scene(one, scenes, PARAMETERS.look_ahead.ahead_m)
    assert np.array_equal(dataset.features[states.scene == 4], alone.features)


def test_pictures_are_chosen_by_the_scene_alone():
    results = made_up_results()
    assert results.paths["reach"].unique().tolist() == ["p1_0", "p1_2", "p2_0", "p2_2"]
    shuffled = results.reaches.assign(hit=~results.reaches["hit"]).sample(frac=1.0, random_state=0)
    assert scene_folds.shown_reaches(shuffled) == ["p1_0", "p1_2", "p2_0", "p2_2"]


def test_a_set_that_is_not_there_leaves_an_empty_folder(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stages/recorded").mkdir(parents=True)
    shutil.copy(root / "stages/recorded/params.yaml", tmp_path / "stages/recorded")
    (tmp_path / "data/raw/recorded/boxes").mkdir(parents=True)  # as the import leaves it
    runpy.run_path(str(root / "stages/recorded/boxes.py"), run_name="__main__")
    assert capsys.readouterr().out.startswith("data/recorded/boxes: left empty")
    assert list((tmp_path / "data/recorded/boxes").iterdir()) == []
    assert RecordedFiles(tmp_path / "data").of_set("boxes") == {}


def test_recorded_people_pass_beside_the_boxes():
    """What the reaches show without any model: nobody touches, gaps are a matter of the scene."""
    public = committed(ScenePeopleParameters, "recorded_boxes")
    recordings = read_reaches_past_boxes(recorded_data("reaches_past_boxes"))
    trials = [synchronise(one, refuse_jumps=False) for one in recordings]  # the stage names them
    reaches, left_out = reaches_past_obstacles(trials, public)
    assert len(reaches) == 269
    assert len(left_out) == 17
    clearance = [
        min(box.signed_distance(one.in_base_frame).min() for box in one.obstacles) for one in reaches
    ]
    assert min(clearance) > 0.0125
    pairs = scene_folds.beside_each_other(reaches)
    assert len(pairs) == 415
    assert pairs["same_gaps"].all()
    assert pairs["path_mm"].mean() == pytest.approx(29.2, abs=0.5)
