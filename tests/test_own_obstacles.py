"""Reaches of one's own past obstacles: made-up hands that pass beside boxes."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from committed import NO_TOPICS, _tree, merged

from structlearn.ground.errors import InputError
from structlearn.ground.minimum_jerk import progress
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.recording import NamedShape
from structlearn.testbeds.own.protocol.own_obstacles import EVERYBODY, learn_past_obstacles, own_reaches
from structlearn.testbeds.own.protocol.own_obstacles_parameters import ObstacleParameters

REST_S, MOVE_S, RATE_HZ = 0.6, 1.2, 90.0
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def chosen(**changes) -> ObstacleParameters:
    values = {key: value for key, value in _tree()["recorded_boxes"].items() if key != "tuned_on"}
    own = {
        "source": "reaches",
        "topics": NO_TOPICS | {"pose": "/hand", "obstacles": None},
        "ignored": ["target"],
    }
    quick = {
        "folds": 2,
        "network": {"members": 1, "training": {"iterations": 2}},
        "text_network": {"training": {"iterations": 2}},
    }
    return ObstacleParameters.model_validate(merged(values | own, quick | changes))


def made_up(name: str, bow: float, x: float, side: float = 0.0) -> Demonstration:
    """A hand that rests, reaches 0.4 m forward with a bow of so many m, and rests."""
    time = np.arange(0.0, MOVE_S + 2 * REST_S, 1.0 / RATE_HZ)
    share = progress(np.clip((time - REST_S) / MOVE_S, 0.0, 1.0))
    position = np.column_stack([side + bow * np.sin(np.pi * share), 0.4 * share, np.full(len(time), 0.8)])
    shapes = (
        NamedShape("crate", "cube", np.array([x, 0.2, 0.8]), UPRIGHT, np.array([0.1, 0.05, 0.12])),
        NamedShape("target", "sphere", np.array([side, 0.4, 0.8]), UPRIGHT, np.full(3, 0.05)),
    )
    return Demonstration(name, time, position, shapes=shapes)


def recordings() -> list[Demonstration]:
    """Blocked and free reaches in turn."""
    found = []
    for number in range(3):
        found.append(made_up(f"blocked {number}", 0.12 + 0.01 * number, 0.0, 0.01 * number))
        found.append(made_up(f"free {number}", 0.01, 0.3, 0.01 * number))
    return found


@lru_cache
def results():
    return learn_past_obstacles({EVERYBODY: recordings()}, chosen())


def test_a_reach_is_the_motion_between_rests_and_targets_are_in_nobodys_way():
    (reach,), left_out = own_reaches({"ann": [made_up("one", 0.1, 0.0)]}, chosen())
    assert left_out.empty
    assert (reach.name, reach.person) == ("ann one", "ann")
    assert reach.duration_s == pytest.approx(MOVE_S, abs=0.2)
    assert len(reach.obstacles) == 1
    np.testing.assert_allclose(reach.in_base_frame[[0, -1], :2], [[0.0, 0.0], [0.0, 0.4]], atol=5e-3)


def test_every_recording_is_judged_by_what_was_learned_from_others():
    rows = results().reaches
    assert rows.groupby("way").size().eq(6).all()
    folds = rows.groupby("person")["fold"].nunique()
    assert folds.eq(1).all()
    assert set(rows["fold"]) == {0, 1}


def test_ways_are_told_apart():
    rows = results().reaches.set_index(["way", "reach"]).sort_index()
    none, planned = rows.loc["none"], rows.loc["planned"]
    assert none["hit"].tolist() == [True] * 3 + [False] * 3
    assert not planned["hit"].any()
    assert rows.loc["scene", "left_mm"].max() < 25.0
    free = none.loc[[f"free {number}" for number in range(3)]]
    assert free["path_mm"].max() < 15.0
    assert results().shapes["reach"].nunique() == 3


def test_people_are_left_out_whole():
    its = recordings()
    found = learn_past_obstacles({"ann": its[:2], "bob": its[2:4], "eve": its[4:]}, chosen(folds=5))
    assert found.reaches.groupby("person")["fold"].nunique().eq(1).all()
    assert found.reaches["fold"].nunique() == 3  # no more than there are people


def test_what_cannot_be_learned_from_is_refused():
    one = made_up("one", 0.1, 0.0)
    in_the_open = replace(one, name="free", shapes=one.shapes[1:])
    with pytest.raises(InputError, match=r"^free: has no obstacles, nor have the others; name"):
        own_reaches({EVERYBODY: [in_the_open]}, chosen())
    reaches, left_out = own_reaches({EVERYBODY: [one, in_the_open]}, chosen())
    assert [reach.name for reach in reaches] == ["one"]
    assert left_out[["trial", "reason"]].to_numpy().tolist() == [["free", "has no obstacles"]]
    with pytest.raises(InputError, match=r"^reaches: of 1 people or recordings with reaches none"):
        learn_past_obstacles({EVERYBODY: [one]}, chosen())
