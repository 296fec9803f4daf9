"""The example task: what its bags hold, and that it can be asked for irregularities."""

import numpy as np
import pytest

from structlearn.readers import read_demonstrations
from structlearn.tasks.pick_and_place_world import MOVES, takes, write_takes
from structlearn.tasks.task_entry import read_task


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two bags."""
    path = tmp_path_factory.mktemp("bags")
    write_takes(takes(1, 3, 2), path)
    return path


def test_the_bags_hold_what_the_entry_names(folder):
    task = read_task("pick")
    for demonstration in read_demonstrations(folder, task.topics, **task.clock.model_dump()):
        assert demonstration.simulated
        assert demonstration.joint_positions.shape[1] == 7
        assert demonstration.wrench[:, 2].min() == pytest.approx(-9.81 * 0.6, abs=0.8)  # the part's weight
        assert demonstration.true_segments.shape == (3, 2)


@pytest.mark.parametrize("moves", MOVES)
def test_irregularities_are_what_was_asked_for(moves):
    plain, odd = takes(7, moves, 3), takes(7, moves, 3, twitch=True, hesitation=True, without={"02": "reach"})
    for take, other in zip(plain, odd, strict=True):
        assert take.moves == tuple(MOVES[moves])
        rests = np.append(take.planned[:, 0], take.time[-1]) - np.append(0.0, take.planned[:, 1])
        assert rests.min() > 0.29  # s
        assert len(other.planned) == moves - (other.name == "02")
        assert (take.planned[:, 0] <= take.segments[:, 0]).all()
        assert (take.segments[:, 1] <= take.planned[:, 1]).all()
    lasts = [take.time[-1] for take in (plain[0], odd[0])]
    assert lasts[1] > lasts[0] + 0.5  # a twitch and the pause after it; a hesitation takes its time
