"""A sample of executions in PyBullet: how far the engines agree, and that they must."""

from dataclasses import replace

import pytest
from board_rollouts import SEED, TESTBED, small_board
from scraping_motions import constant_network

from structlearn.testbeds.scraping.world.engine_agreement import LARGEST, engine_differences


@pytest.fixture(scope="module")
def board():
    return small_board()


def test_rollouts_of_both_engines_agree(board):
    found = board.engine_differences({"turn": constant_network(5.0)})
    assert set(found) == set(LARGEST)
    assert found["position_m"] < 1e-10
    assert found["torque_n_m"] < 1e-7
    assert found["counts"] == 0.0


def test_a_disagreement_is_an_error(board):
    network = constant_network(5.0)

    def other_board(testbed):
        own = replace(board, testbed=testbed, setting_deg=5.0 if testbed.engine == "compiled" else 6.0)
        return [own.execution(network, SEED)]

    with pytest.raises(RuntimeError, match="the engines differ: position_m by"):
        engine_differences(other_board, TESTBED)


def test_in_pybullet_there_is_nothing_to_compare():
    def never(testbed):
        raise AssertionError

    assert engine_differences(never, TESTBED.model_copy(update={"engine": "pybullet"})) == {}
