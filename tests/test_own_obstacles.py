"""Reaches of one's own past obstacles: made-up hands that pass beside boxes."""

import numpy as np
import pytest
import yaml
from committed import NO_TOPICS, TASK_FILE, merged

from structlearn.avoidance.scene_people import learn_past_obstacles
from structlearn.core.errors import InputError
from structlearn.core.minimum_jerk import progress
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.recording import NamedShape
from structlearn.tasks.task_entry import ObstacleEntry

REST_S, MOVE_S, RATE_HZ = 0.6, 1.2, 90.0
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def chosen(**changes) -> ObstacleEntry:
    values = yaml.load(TASK_FILE.read_text(), yaml.CSafeLoader)["defaults"]["obstacles"]
    own = {"source": "reaches", "topics": NO_TOPICS | {"pose": "/hand", "obstacles": None}}
    quick = {
        "folds": 2,
        "network": {"members": 1, "training": {"iterations": 2}},
        "text_network": {"training": {"iterations": 2}},
    }
    return ObstacleEntry.model_validate(merged(values | own, quick | changes))


def made_up(name: str, bow: float, x: float, side: float = 0.0) -> Demonstration:
    """A hand that rests, reaches 0.4 m forward with a bow of so many m, and rests."""
    time = np.arange(0.0, MOVE_S + 2 * REST_S, 1.0 / RATE_HZ)
    share = progress(np.clip((time - REST_S) / MOVE_S, 0.0, 1.0))
    position = np.column_stack([side + bow * np.sin(np.pi * share), 0.4 * share, np.full(len(time), 0.8)])
    shapes = (
        NamedShape("crate", "cube", np.array([x, 0.2, 0.8]), UPRIGHT, np.array([0.1, 0.05, 0.12])),
        NamedShape("target", "sphere", np.array([side, 0.4, 0.8]), UPRIGHT, np.full(3, 0.05)),
    )
    return Demonstration(name, time, position, shapes=shapes, provenance={"person": name})


def recordings() -> list[Demonstration]:
    """Blocked and free reaches in turn."""
    found = []
    for number in range(3):
        found.append(made_up(f"blocked {number}", 0.12 + 0.01 * number, 0.0, 0.01 * number))
        found.append(made_up(f"free {number}", 0.01, 0.3, 0.01 * number))
    return found


def test_reaches_of_a_task_are_learned_from_without_times_and_people():
    rows = learn_past_obstacles(recordings(), chosen()).reaches
    assert rows.groupby("way").size().eq(6).all()
    assert rows.groupby("person")["fold"].nunique().eq(1).all()
    assert set(rows["fold"]) == {0, 1}
    none = rows.set_index("way").loc["none"]
    assert none["hit"].to_numpy().sum() == 3
    with pytest.raises(InputError, match=r"^reaches of 1 people, 1 of them"):
        learn_past_obstacles(recordings()[:1], chosen())
