"""The board as the files of the stages describe it."""

import numpy as np
import pytest
from board_rollouts import RATE_HZ, small_board
from committed import committed
from feedback_toy import toy_dataset
from scraping_motions import scraping_skill

from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.skill import largest_coupling
from structlearn.ground.artefacts import write_table
from structlearn.ground.errors import InputError
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.recordings import synchronise
from structlearn.recordings.runs import read_runs, write_runs
from structlearn.recordings.source import ClockParameters
from structlearn.testbeds.scraping.protocol.board_files import read_board
from structlearn.testbeds.scraping.protocol.execution_scores import nominal_orientation
from structlearn.testbeds.scraping.protocol.executions import execute_run, nominal_runs

CLOCK = committed(ClockParameters, "clock", rate_hz=RATE_HZ)


@pytest.fixture(scope="module")
def board():
    return small_board()


@pytest.fixture
def data(board, tmp_path):
    """What the stages before have written, with toy demonstrations of 0, 5 and 10 degrees."""
    write_primitives(board.primitives, tmp_path / "primitives/scraping/primitives.safetensors")
    for name, expected in board.expected.items():
        write_vector_primitive(
            expected, tmp_path / f"feedback/scraping/expected/{name}.safetensors", "traces"
        )
    runs = [execute_run(run, 0, scraping_skill(), board.testbed) for run in nominal_runs(1)]
    clocked = [synchronise(run, **CLOCK.model_dump()) for run in runs]
    write_runs(clocked, tmp_path / "runs/scraping/unrolls.parquet")
    write_table(to_table(toy_dataset()), tmp_path / "feedback/scraping/dataset/turn.parquet")
    return tmp_path


def read(data, board, settings=(5.0, 10.0)):
    return read_board(data, settings, 20.0, board.supervision, board.testbed, CLOCK)


def test_the_board_is_read_with_the_demonstrations_of_the_settings_asked_for(data, board):
    found, datasets = read(data, board)
    assert (found.name, found.setting_deg, found.preceding) == ("turn", 20.0, {})
    assert [one.name for one in found.primitives] == [one.name for one in board.primitives]
    assert found.expected.keys() == board.expected.keys()
    assert set(datasets["turn"].setting) == {5.0, 10.0}
    unrolls = read_runs(data / "runs/scraping/unrolls.parquet")
    np.testing.assert_array_equal(found.nominal, nominal_orientation(unrolls))


def test_what_is_not_learned_from_does_not_bound_the_feedback(data, board):
    """The largest coupling of the new setting is not known there."""
    for settings in ((0.0,), (0.0, 5.0, 10.0)):
        found, datasets = read(data, board, settings)
        assert found.limits.largest_coupling == {"ry": largest_coupling([datasets["turn"].target])}


def test_a_setting_without_corrections_is_named(data, board):
    with pytest.raises(InputError, match=r"turn\.parquet: has no corrections in the settings 6\.3"):
        read(data, board, (5.0, 6.3))
