"""Refinement of both primitives, on a board whose executions are made up."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from board_rollouts import small_board
from committed import committed
from feedback_toy import toy_dataset
from scraping_motions import NAMES

from dissertation.scraping.protocol import board_refinement
from structlearn.core.errors import InputError
from structlearn.feedback.trainers import TrainingParameters, train_final
from structlearn.policy_search import refinement
from structlearn.policy_search.pi2 import PI2Parameters
from structlearn.policy_search.refinement import Rollout, open_loop_weights

TURN, SCRAPE = NAMES[1:]
DATASETS = {TURN: toy_dataset(seed=0), SCRAPE: toy_dataset(seed=1)}
PARAMETERS = committed(
    board_refinement.BoardRefinementParameters,
    "refine",
    settings_deg=(0.0, 5.0, 10.0),
    setting_deg=20.0,
    exploration={TURN: 5.0, SCRAPE: 3.0},
    shown_runs=2,
    level_runs=1,
    hidden=(5,),
    iterations=2,
    search=committed(PI2Parameters, "refine.search", samples=3),
    evaluation_runs=2,
    added_runs=2,
    training=committed(TrainingParameters, "compare_models", steps=20, evaluate_every=10),
)
TESTS = []
"""Name, setting, preceding networks and executed networks of every call of a board."""


@dataclass(frozen=True)
class MadeUpBoard(board_refinement.BoardEnvironment):
    """Executions are demonstrations with the coupling term of the network."""

    @property
    def rate_hz(self):
        return 100.0

    def rollouts(self, networks, seeds):
        TESTS.append((self.name, self.setting_deg, dict(self.preceding), list(networks)))
        return [self._rollout(network, seed) for network, seed in zip(networks, seeds, strict=True)]

    def _rollout(self, network, seed):
        data = DATASETS[self.name]
        one = data.where((data.setting == 10.0) & (data.demonstration == seed[2] % 4))
        one = replace(one, time=np.arange(len(one.time)) / 100.0)
        coupling = network.coupling(one.deviation[:, : network.inputs], one.phase, one.phase_velocity)
        return Rollout(np.abs(coupling - one.target), replace(one, target=coupling))


@pytest.fixture(scope="module")
def board():
    real = small_board()
    return MadeUpBoard(**{**vars(real), "setting_deg": PARAMETERS.setting_deg})


def same_network(one, other):
    return all(map(np.array_equal, one.arrays().values(), other.arrays().values()))


def test_a_primitive_is_refined_while_those_before_it_run_refined(board):
    TESTS.clear()
    before, after, _ = board_refinement.refine_on_board(board, DATASETS, PARAMETERS)
    assert list(dict.fromkeys(name for name, *_ in TESTS)) == [TURN, SCRAPE]
    for name, _, preceding, _ in TESTS:
        assert list(preceding) == ([] if name == TURN else [TURN])
        if name == SCRAPE:
            assert same_network(preceding[TURN], after[TURN])
    assert not same_network(after[TURN], before[TURN])


def test_what_is_right_in_known_settings_is_executed_there_and_learned_from(board, monkeypatch):
    """People's mean correction in each setting they showed; none on the level board."""
    learned = []

    def remember(model, data, *arguments, **others):
        learned.append(data)
        return train_final(model, data, *arguments, **others)

    monkeypatch.setattr(refinement, "train_final", remember)
    TESTS.clear()
    board_refinement.refine_on_board(board, DATASETS, PARAMETERS.model_copy(update={"iterations": 1}))
    data = DATASETS[TURN]
    own = [(setting, networks) for name, setting, _, networks in TESTS if name == TURN]
    known = [one for one in own if one[0] != PARAMETERS.setting_deg]
    assert [(setting, len(networks)) for setting, networks in known] == [
        *((setting, PARAMETERS.shown_runs) for setting in np.unique(data.setting)),
        (0.0, PARAMETERS.level_runs),
    ]
    for setting, networks in known[:-1]:
        mean = open_loop_weights(data.where(data.setting == setting))
        np.testing.assert_array_equal(networks[0].phase_biases, mean)
    np.testing.assert_array_equal(known[-1][1][0].phase_biases, 0.0)
    retrained = next(one for one in learned if len(one.target) > len(data.target))
    executions = len(known[:-1]) * PARAMETERS.shown_runs + PARAMETERS.level_runs + PARAMETERS.added_runs
    new = retrained.where(np.arange(len(data.target), len(retrained.target)))
    assert np.sum(new.time == 0.0) == executions


def test_in_the_text_s_form_only_what_was_tried_is_added(board):
    TESTS.clear()
    text = PARAMETERS.model_copy(update={"shown_runs": 0, "level_runs": 0})
    board_refinement.refine_on_board(board, DATASETS, text)
    assert {setting for _, setting, _, _ in TESTS} == {PARAMETERS.setting_deg}


@pytest.mark.parametrize("explored", [{SCRAPE}, set()])
def test_a_primitive_without_exploration_keeps_its_model(explored, board):
    parameters = PARAMETERS.model_copy(update={"exploration": dict.fromkeys(explored, 5.0)})
    before, after, tables = board_refinement.refine_on_board(board, DATASETS, parameters)
    for name in {TURN, SCRAPE} - explored:
        assert same_network(after[name], before[name])
    assert set(tables["history"].get("primitive", ())) == explored


def test_a_primitive_without_corrections_is_named(board):
    unknown = PARAMETERS.model_copy(update={"exploration": {"slide": 5.0}})
    with pytest.raises(InputError, match=r"refine\.exploration names slide: no primitive with corrections"):
        board_refinement.refine_on_board(board, DATASETS, unknown)
