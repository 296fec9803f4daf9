"""Rivals see what was recorded, act as trained, and meet the same conditions as our feedback."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch
import yaml
from board_rollouts import TESTBED
from committed import ROOT, committed, parameter_tree, read_yaml
from scraping_motions import scraping_skill
from viewer_files import chunks, verify

from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import RESULTS, Study, read_study
from dissertation.evidence.study_cells import planned_cells, read_descriptions, run_cell, seeds_of
from dissertation.evidence.study_tables import made_with
from dissertation.rivals import choice, imitation_data, policies, policy_execution, protocol
from dissertation.rivals.choice import TrialParameters, choose, drawn_methods, trial_costs
from dissertation.rivals.imitation_data import (
    DemonstrationParameters,
    Episode,
    bench_of,
    episodes,
    first,
    frame_of,
    record,
)
from dissertation.rivals.networks import ActionChunking, Feedforward
from dissertation.rivals.page.findings import AVOIDING, LOOKS
from dissertation.rivals.page.rivals_page import Compared, page
from dissertation.rivals.page.rivals_view import executed_once, side_by_side
from dissertation.rivals.policies import (
    SPEED_MARGIN,
    Ensemble,
    RivalParameters,
    Units,
    fastest,
    train,
)
from dissertation.rivals.policy_execution import Leader, bounded, execute_policy
from dissertation.rivals.protocol import (
    AS_DEMONSTRATED,
    CAP_RAD,
    KNOCKED,
    MODELS,
    NOMINAL,
    OURS,
    RIVALS,
    ComparisonParameters,
    MethodParameters,
    compare,
    moved_runs,
    planned_runs,
    results_of,
    run_scores,
    trained_feedback,
)
from dissertation.rivals.reaching.reaching_protocol import (
    FAR,
    NEAR,
    UNSEEN,
    ReachingParameters,
    ReachingTrialParameters,
)
from dissertation.rivals.situations import UNMOVED, Situation, execute_skill, moved
from dissertation.scraping.protocol import executions
from dissertation.scraping.protocol.execution_scores import orientation_cost
from dissertation.scraping.protocol.executions import Run, execute_run, nominal_runs
from dissertation.simulation.fingers import FingerPair
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.parallel import BACKEND
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.runtime import Controller
from structlearn.primitives.sequence import PoseGoal, default_start
from structlearn.primitives.vector import without_offset
from structlearn.readers.clock import synchronise
from structlearn.readers.source import ClockParameters
from structlearn.viewer.items import entity
from structlearn.viewer.recording import publish_recordings

TINY = {"width": 8, "layers": 1, "every": 4, "chunk": 3, "steps": 4, "batch": 3}
RUN = Run("01", 5.0, (13, 1, 0))
SHIFT = Situation("shifted", (0.01, -0.02, 0.0), (-0.01, 0.015, 0.0))


def rival(network, **changes):
    return committed(RivalParameters, f"rival_methods.{network}", **TINY | changes)


@pytest.fixture(scope="module")
def small():
    """A short task on the board, and executions of it: level, and corrected at two tilts."""
    parameters = committed(
        DemonstrationParameters,
        "rivals.demonstrations",
        settings_deg=(5.0, 10.0),
        runs=2,
        level_runs=2,
        expected_runs=2,
    )
    supervision = committed(SupervisionParameters, "coupling_dataset")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(BACKEND, "sequential")
        clock = committed(ClockParameters, "clock")
        bench = bench_of(scraping_skill(expected=False), TESTBED, clock, supervision, parameters)
        return bench, record(bench, parameters), parameters


@pytest.fixture(scope="module")
def seen(small):
    bench, recorded, _ = small
    return episodes(bench, recorded)


class Copier:
    """Repeats the poses of a run, whatever it senses, and remembers that."""

    def __init__(self, run, frame, every=1):
        self.parameters = SimpleNamespace(every=every, network="copied")
        self.fastest = 0.01, 0.05
        self.poses = frame.relative(run.position, run.orientation)[::3]
        self.sensed, self.every = [], every

    def chunk(self, pose, task, touch):
        self.sensed.append(np.concatenate([pose, task, touch]))
        later = len(self.sensed) * self.every
        return self.poses[min(later, len(self.poses) - 1)][None]


@pytest.mark.parametrize("network", RIVALS)
def test_a_policy_gives_chunks_and_the_same_ones_again(seen, network):
    parameters, one = rival(network), seen[0]
    inputs = one.pose[0], one.task[0], one.touch[0]
    first, again, other = (train(seen, parameters, seed).chunk(*inputs) for seed in (1, 1, 2))
    assert first.shape == (3, 6)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.0


def test_training_leaves_other_random_numbers_alone(seen):
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    train(seen, rival("chunking"), 1)
    assert torch.equal(torch.rand(3), expected)


def test_a_network_learns_what_it_is_shown(seen):
    """With enough steps, the next pose of a demonstration from what was seen there."""
    parameters = rival("feedforward", width=64, layers=2, steps=1500, batch=64, chunk=1, noise=0.0)
    policy, one = train(seen, parameters, 1), seen[-1]
    found = np.array([policy.chunk(one.pose[k], one.task[k], one.touch[k])[0] for k in range(200)])
    error = found - one.pose[4:204]
    assert np.abs(error[:, :3]).max() < 0.2 * np.ptp(one.pose[:, :3], axis=0).max()
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(one.pose[4:204] - one.pose.mean(axis=0))


def test_the_transformer_draws_a_style_in_training_alone():
    torch.manual_seed(0)
    network = ActionChunking((10, 38), 6, 8, 1, 3).eval()  # no dropout
    state, touch, actions = torch.randn(2, 10), torch.randn(2, 38), torch.randn(2, 3, 6)
    with torch.no_grad():
        once, again = (network(state, touch, actions) for _ in range(2))
        acting = [network(state, touch) for _ in range(2)]
    assert (once[0] - again[0]).abs().max() > 0.0
    assert once[1] > 0.0
    assert torch.equal(acting[0][0], acting[1][0])
    assert acting[0][1] == 0.0


@pytest.fixture
def trained_on(monkeypatch):
    """Trains a feed-forward rival; returns it with all states, readings and targets that it has seen."""

    def trained(shown, noise):
        batches = []

        class Witness(Feedforward):
            def forward(self, *inputs):
                batches.append(inputs)
                return super().forward(*inputs)

        monkeypatch.setitem(policies.NETWORKS, "feedforward", Witness)
        policy = train(shown, rival("feedforward", noise=noise, steps=40, batch=50), 1)
        return policy, *(torch.cat(its).numpy() for its in zip(*batches, strict=True))

    return trained


COUNTED = [0.0, 0.0, 5.0], [40, 30, 14]
"""Settings and lengths of episodes in which x and -y/2 count all samples."""


@pytest.fixture(scope="module")
def counted():
    rng = np.random.default_rng(0)
    numbers = np.split(np.arange(84.0), np.cumsum(COUNTED[1])[:-1])
    return [
        Episode(setting, one[:, None] * [1.0, -2.0, 0.0], *(rng.random((len(one), size)) for size in (4, 5)))
        for setting, one in zip(COUNTED[0], numbers, strict=True)
    ]


def test_targets_are_the_next_decisions_and_the_hand_rests_at_an_episodes_end(counted, trained_on):
    policy, state, _, actions = trained_on(counted, noise=0.0)
    poses = [its * policy.pose.scale + policy.pose.mean for its in (state[:, None, :3], actions)]
    sample = np.round(poses[0][..., 0])
    later = sample + np.array([4, 8, 12])  # every 4 samples, chunks of 3
    last = np.cumsum(COUNTED[1]) - 1
    expected = np.minimum(later, last[np.searchsorted(last, sample)])
    assert (expected < later).any()
    np.testing.assert_allclose(poses[1], expected[..., None] * [1.0, -2.0, 0.0], atol=1e-3)


def test_every_setting_counts_alike_in_training(counted, trained_on):
    policy, state, *_ = trained_on(counted, noise=0.0)
    sample = state[:, 0] * policy.pose.scale[0] + policy.pose.mean[0]
    first_one, first_setting = (sample < 39.5).mean(), (sample < 69.5).mean()
    assert first_setting == pytest.approx(0.5, abs=0.05)  # of 70 samples in 84
    assert first_one == pytest.approx(0.5 * 40 / 70, abs=0.05)


def test_noise_is_added_to_poses_and_readings_alone(counted, trained_on):
    clean, noisy = (trained_on(counted, noise)[1:] for noise in (0.0, 0.5))
    state, touch, actions = (one - other for one, other in zip(noisy, clean, strict=True))
    assert state[:, :3].std(axis=0) == pytest.approx([0.5] * 3, rel=0.1)
    assert touch.std(axis=0) == pytest.approx([0.5] * 5, rel=0.1)
    np.testing.assert_array_equal(state[:, 3:], 0.0)
    np.testing.assert_array_equal(actions, 0.0)


def test_the_fastest_reference_is_somewhat_faster_than_any_demonstration():
    ramp = np.arange(31.0)[:, None] * [0.003, 0.0, 0.004, 0.0, 0.02, 0.0]
    shown = [Episode(0.0, factor * ramp, *np.zeros((2, 31, 4))) for factor in (1.0, 0.5)]
    assert fastest(shown) == pytest.approx([0.005 * SPEED_MARGIN, 0.02 * SPEED_MARGIN])
    assert fastest([one._replace(pose=one.pose[:, :3]) for one in shown]) == pytest.approx(
        [0.005 * SPEED_MARGIN]
    )


@pytest.mark.parametrize("decay", [0.0, 0.3])
def test_temporal_ensembling_is_the_weighted_mean_of_all_predictions_for_a_moment(decay):
    rng, ensemble = np.random.default_rng(0), Ensemble(decay)
    chunks = rng.standard_normal((12, 5, 6))
    for now in range(12):
        found = ensemble.update(chunks[now])
        total, weight, age_rank = np.zeros(6), 0.0, 0
        for made in range(now + 1):  # oldest first
            if now - made < 5:
                w = np.exp(-decay * age_rank)
                total, weight, age_rank = total + w * chunks[made, now - made], weight + w, age_rank + 1
        np.testing.assert_allclose(found, total / weight, rtol=1e-12)


def test_units_have_one_scale_per_unit():
    values = np.random.default_rng(0).standard_normal((500, 4)) * [1.0, 3.0, 5.0, 0.0]
    units = Units.of(values, (2, 1, 1))
    np.testing.assert_allclose(units.scale, [np.sqrt(5.0)] * 2 + [5.0, 1.0], rtol=0.1)


def test_moved_primitives_are_those_that_the_controller_plans():
    skill, rate = scraping_skill(), 300.0
    goals = [PoseGoal(one.position.goal + SHIFT.goal, one.orientation.goal) for one in skill.primitives]
    begin = default_start(skill.primitives)
    there, planned = moved(skill, SHIFT), Controller(skill, rate, goals=goals)
    its = Controller(there, rate)
    planned.start(begin.position + SHIFT.start, begin.orientation)
    its.start(default_start(there.primitives).position, begin.orientation)
    for _ in range(700):
        planned.tick(None)
        its.tick(None)
        np.testing.assert_allclose(its.position, planned.position, atol=1e-12)


def test_demonstrations_start_and_end_where_they_are_told_within_the_range(small, seen):
    _, recorded, parameters = small
    flat = [situation for its in recorded.values() for situation, _ in its]
    assert len(flat) == len(seen) == 6
    for situation in flat:
        assert (np.abs([situation.start, situation.goal]) <= parameters.range_m).all()
    assert len({tuple(one.start) for one in flat}) == 6
    for one in seen:
        assert np.linalg.norm(one.pose[-1, :2]) < 2e-3  # at the goal
        np.testing.assert_allclose(one.pose[0, :3], one.task[0, :3], atol=1e-6)
    assert [len(its) for its in first(recorded, 1).values()] == [2, 1, 1]


def test_nobody_corrects_on_the_level_board(small):
    bench, _, parameters = small
    with pytest.raises(InputError, match="nothing is corrected on the level board"):
        record(bench, parameters.model_copy(update={"settings_deg": (0.0, 5.0)}))


def test_a_copied_execution_is_reproduced_and_what_is_sensed_is_what_was_recorded(small):
    bench, *_ = small
    frame = frame_of(moved(bench.skill, SHIFT))
    nominal = execute_skill(RUN, bench.skill, bench, SHIFT)
    copier = Copier(nominal, frame)
    copied = execute_policy(RUN, copier, bench, SHIFT)
    assert np.abs(copied.position - nominal.position).max() < 1e-3
    assert np.degrees(quaternion.angle_between(copied.orientation, nominal.orientation).max()) < 0.3
    scores = [run_scores(bench, one, SHIFT) for one in (nominal, copied)]
    assert scores[1]["cost"] == pytest.approx(scores[0]["cost"], rel=0.05)
    assert scores[0]["failed"] == scores[1]["failed"] == 0.0
    (recorded,) = episodes(bench, {5.0: [(SHIFT, copied)]})
    online = np.array(copier.sensed)[5 : len(recorded.pose) - 5]
    rows = slice(5, len(recorded.pose) - 5)
    np.testing.assert_allclose(online[:, :6], recorded.pose[rows], atol=1e-9)
    np.testing.assert_allclose(online[:, 6:10], recorded.task[rows], atol=1e-9)
    apart = online[:, 10:] - recorded.touch[rows]
    assert np.abs(apart).max() < 0.1 * np.abs(online[:, 10:]).max()  # stamps jitter
    assert np.abs(apart.mean(axis=0)).max() < 0.5


def test_rivals_see_readings_less_the_expected_ones(small, seen):
    _, level = small[1][0.0][0]
    raw = without_offset(level.tactile[::3])
    assert np.sqrt(np.mean(seen[0].touch[5:] ** 2)) < 0.5 * np.sqrt(np.mean(raw[5:] ** 2))


def test_rivals_and_the_skill_meet_equal_conditions(small, monkeypatch):
    """A rival that copies the skill feels the same board: readings are equal until their paths part."""
    bench, met = small[0], []

    def spied(conditions):
        return lambda *its, **more: met.append(conditions(*its, **more)) or met[-1]

    for module in (executions, policy_execution):
        monkeypatch.setattr(module, "run_conditions", spied(module.run_conditions))
    nominal = execute_skill(RUN, bench.skill, bench, UNMOVED)
    copied = execute_policy(RUN, Copier(nominal, frame_of(bench.skill)), bench, UNMOVED)
    np.testing.assert_allclose(copied.tactile[0], nominal.tactile[0], atol=1.0)
    np.testing.assert_allclose(copied.wrench[0], nominal.wrench[0], atol=1e-9)
    assert len(met) == 2
    for one, other in zip(*met, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_knock_takes_the_tool_off_and_none_changes_no_bit(small):
    bench, *_ = small
    knock = Situation(KNOCKED, knock_n=(0.0, 0.0, 20.0), knock_s=(1.0, 1.2))
    late = replace(knock, knock_s=(1e3, 2e3))  # after the run's end, but tick by tick
    calm, knocked, none = (execute_skill(RUN, bench.skill, bench, one) for one in (UNMOVED, knock, late))
    plain = synchronise(execute_run(RUN, 0, bench.skill, TESTBED), 300.0, bench.clock.max_gap_s)
    for one in (calm, none):
        np.testing.assert_array_equal(one.position, plain.position)
        np.testing.assert_array_equal(one.tactile, plain.tactile)
    np.testing.assert_array_equal(knocked.position[:300], plain.position[:300])
    during = slice(330, 360)
    assert calm.wrench[during, 2].mean() < -0.5
    assert np.abs(knocked.wrench[during, 2].mean()) < 0.1
    assert (knocked.position - plain.position)[during, 2].max() > 1e-3


def test_a_reference_moves_no_faster_than_demonstrations_and_is_smooth(small):
    bench, dt = small[0], 1.0 / 300.0
    own = bench.testbed
    fingers = FingerPair(own.touch, own.sensor_seed, np.random.default_rng(0), own.finger_rate_hz)
    policy = SimpleNamespace(parameters=rival("feedforward"), fastest=(0.001, 0.005))
    leader = Leader(policy, bench.skill, fingers, 60, dt)
    begin, path, far = leader.pose, leader.reference, np.array([1.0, 0, 0, 0, 2.0, 0])
    leader._write(0, begin + far)
    leader._write(12, begin + far)
    np.testing.assert_allclose(leader.pose - begin, [0.008, 0, 0, 0, 0.04, 0], atol=1e-15)
    speeds = np.diff(path.position[:25, 0]) / dt
    np.testing.assert_allclose(0.5 * (path.velocity[:24, 0] + path.velocity[1:25, 0]), speeds, atol=1e-2)
    assert np.abs(np.diff(speeds)).max() < 0.05
    np.testing.assert_allclose(path.velocity[[12, 24], 0], 0.1)
    np.testing.assert_array_equal(bounded(np.zeros(6), np.ones(2)), np.zeros(6))


def test_a_width_that_heads_cannot_share_is_refused():
    with pytest.raises(ValueError, match="multiple of 4"):
        RivalParameters.model_validate(rival("chunking").model_dump() | {"width": 10})


def test_a_rival_that_puts_out_nonsense_has_failed(small, monkeypatch):
    bench, recorded, _ = small
    policy = SimpleNamespace(parameters=rival("feedforward"), chunk=lambda *_: np.full((3, 6), np.nan))
    monkeypatch.setattr(protocol, "train", lambda *_: policy)
    monkeypatch.setenv(BACKEND, "sequential")
    trial = protocol.Trial("feedforward", 2, policy.parameters, recorded, [(RUN, UNMOVED)])
    scores = results_of(7, bench, [trial], 1).set_index("quantity")["value"]
    ticks = sum(round(300 * one.duration) for one in bench.skill.primitives[1:])
    assert scores["failed"] == 1.0
    assert scores["cost"] == pytest.approx(ticks * np.radians(30.0), rel=0.01)
    assert set(scores.index) == {"failed", "cost"}  # where it ended, and how, is not known


@pytest.fixture(scope="module")
def executed(small):
    """An execution with other start and goals that has not failed."""
    return execute_skill(RUN, small[0].skill, small[0], SHIFT)


def away(run, bench, distance_m):
    """Ends so far from its goal along x."""
    position = run.position.copy()
    position[700:, :2] = (bench.skill.primitives[-1].position.goal + SHIFT.goal)[:2]
    position[700:, 0] += distance_m
    return replace(run, position=position)


def pressed(run, bench, share, ticks=slice(None)):
    """Presses with a share of the commanded force."""
    wrench = run.wrench.copy()
    wrench[ticks, 2] = -share * bench.testbed.control.force_n
    return replace(run, wrench=wrench)


def turned(run, bench, angle_deg, ticks=slice(None)):
    """Has its tool so far from the nominal orientation on the board."""
    tool = run.tool_to_board.copy()
    off = quaternion.from_rotation_vector(np.radians([0.0, angle_deg, 0.0]))
    nominal = bench.nominal[: len(tool)]
    tool[: len(nominal)][ticks] = quaternion.product(off, nominal)[ticks]
    return replace(run, tool_to_board=tool)


FAILED = [  # all primitives end at 720 ticks, the first one at 180, and the last one starts at 480
    (away, 0.011, 1.0),
    (away, -0.011, 1.0),
    (away, 0.009, 0.0),
    (pressed, 0.4, 1.0),
    (pressed, 1.6, 1.0),
    (pressed, 0.6, 0.0),
    (pressed, 1.4, 0.0),
    (turned, 40.0, 1.0),
    (turned, 29.0, 0.0),
]


@pytest.mark.parametrize(("change", "size", "failed"), FAILED)
def test_a_run_fails_by_its_goal_its_force_or_its_tool(small, executed, change, size, failed):
    bench = small[0]
    assert run_scores(bench, executed, SHIFT)["failed"] == 0.0
    assert run_scores(bench, change(executed, bench, size), SHIFT)["failed"] == failed


def test_only_the_end_of_the_force_and_primitives_with_feedback_count(small, executed):
    bench = small[0]
    early, late = slice(0, 600), slice(600, None)
    assert run_scores(bench, pressed(executed, bench, 0.0, early), SHIFT)["failed"] == 0.0
    assert run_scores(bench, pressed(executed, bench, 0.0, late), SHIFT)["failed"] == 1.0
    cost, off = run_scores(bench, executed, SHIFT)["cost"], orientation_cost(executed, bench.nominal)
    assert cost == pytest.approx(off[180:720].sum())
    before = run_scores(bench, turned(executed, bench, 40.0, slice(0, 180)), SHIFT)
    assert (before["cost"], before["failed"]) == (pytest.approx(cost), 0.0)
    once = run_scores(bench, turned(executed, bench, 40.0, slice(180, 181)), SHIFT)
    assert (once["cost"], once["failed"]) == (pytest.approx(cost - off[180] + CAP_RAD), 1.0)


def test_a_run_has_the_distance_from_its_own_goal_and_the_jerk_below_the_limit(small, executed):
    bench = small[0]
    assert run_scores(bench, away(executed, bench, 0.004), SHIFT)["goal"] == pytest.approx(4.0)
    share = np.linspace(0.0, 1.0, len(executed.time))
    slow, fast = (np.sin(np.pi * count * share) for count in (4, 2 * round(60.0 * executed.time[-1])))
    path = slow[:, None] * [1.0, 2.0, 2.0] + 1e-4 * fast[:, None]
    jerk = 3.0 * (4.0 * np.pi / executed.time[-1]) ** 3 / np.sqrt(2.0)
    found = run_scores(bench, replace(executed, position=path), SHIFT)["jerk"]
    assert found == pytest.approx(jerk, rel=0.05)  # ends differ; that of 60 Hz, 30 times as much, is gone


@pytest.fixture(scope="module")
def comparison(small):
    return committed(
        ComparisonParameters,
        "rivals",
        demonstrations=small[2].model_dump(),
        counts=(1, 2),
        settings_deg=(0.0, 10.0),
        runs=1,
        moved={"knock_s": (0.3, 0.4)},
    )


METHODS = committed(
    MethodParameters,
    "rival_methods",
    ours={"hidden": (4,), "pointwise": {"steps": 20, "evaluate_every": 10}},
    **dict.fromkeys(RIVALS, TINY),
)


def test_a_reduced_cell_runs_from_demonstrations_to_results(small, comparison, monkeypatch):
    monkeypatch.setenv(BACKEND, "sequential")
    bench, recorded, _ = small
    results = compare(7, bench, recorded, comparison, METHODS)
    assert set(results["person"]) == {7}
    costs = results[results["quantity"] == "cost"].set_index(["model", "level", "part", "setting"])["value"]
    at = costs.loc[NOMINAL].droplevel("level")
    assert at[AS_DEMONSTRATED, 10.0] > 3.0 * at[AS_DEMONSTRATED, 0.0]
    situations = {
        AS_DEMONSTRATED,
        KNOCKED,
        *(f"{one} {how}" for one in ("start", "goal") for how in ("within", "beyond")),
    }
    for model in (OURS, *RIVALS):
        own = costs.loc[model]
        assert set(own.loc[2.0].index.unique("part")) == situations
        assert set(own.loc[1.0].index.unique("part")) == {AS_DEMONSTRATED}
        assert own[1.0, AS_DEMONSTRATED, 10.0] != own[2.0, AS_DEMONSTRATED, 10.0]
    few = compare(7, bench, recorded, comparison.model_copy(update={"counts": (2,)}), METHODS)
    again = few[few["model"] == "chunking"]["value"].to_numpy()
    expected = results[(results["model"] == "chunking") & (results["level"] == 2.0)]["value"].to_numpy()
    np.testing.assert_array_equal(again, expected)
    with pytest.raises(InputError, match="3 demonstrations per tilt, of which only 2 are recorded"):
        compare(7, bench, recorded, comparison.model_copy(update={"counts": (1, 3)}), METHODS)


def test_methods_learn_from_as_many_demonstrations_as_are_asked_for(small, comparison, monkeypatch):
    bench, recorded, _ = small
    for module in (protocol, choice):
        monkeypatch.setattr(module, "results_of", lambda person, bench, trials, seed: trials)
    drawing = committed(TrialParameters, "rival_trials", count=1)
    compared, tried = (
        compare(7, bench, recorded, comparison, METHODS)[1:],
        choose(7, bench, recorded, drawing, 1),
    )
    assert [(one.model, one.level) for one in compared] == [*product(MODELS[1:], (1, 2))]
    assert len(tried) == 3 * drawing.trials
    shown = [[len(its) for its in one.recorded.values()] for one in (*compared, *tried)]
    assert shown == [[2, 1, 1], [2, 2, 2]] * 3 + [[2, 1, 1]] * len(tried)  # all on the level board


def test_feedback_learns_from_level_executions_that_nothing_is_to_be_corrected(small, monkeypatch):
    (bench, recorded, _), shown, trained = small, [], protocol.train_final
    monkeypatch.setattr(protocol, "train_final", lambda *its: shown.append(its[1]) or trained(*its))
    limits = trained_feedback(bench, recorded, METHODS.ours).limits
    assert len(shown) == len(bench.supervision.primitives)
    for its in shown:
        assert {*its.setting.astype(float)} == {0.0, 5.0, 10.0}
        level = its.setting.astype(float) == 0.0
        np.testing.assert_array_equal(its.target[level], 0.0)
        assert np.abs(its.target[~level]).max() > 0.0
        assert {*its.demonstration[level]} == {0, 1}
    assert limits.largest_coupling[bench.supervision.axis] > 0.0


def test_starts_goals_and_knocks_are_where_and_when_they_are_told(small, comparison):
    plan, reach = moved_runs(small[0], comparison), np.array(small[2].range_m)
    found = {situation.name: situation for _, situation in plan}
    assert len(found) == len(plan) == 5
    for name, factor in (("within", 0.8), ("beyond", 2.0)):
        start, goal = found[f"start {name}"], found[f"goal {name}"]
        np.testing.assert_allclose(np.abs([start.start, goal.goal]), [factor * reach] * 2)
        np.testing.assert_array_equal([start.goal, goal.start], 0.0)
    knock = found[KNOCKED]
    assert knock.knock_s == pytest.approx((0.6 + 0.3, 0.6 + 0.4))  # the first primitive takes 0.6 s
    assert knock == replace(UNMOVED, name=KNOCKED, knock_n=comparison.moved.knock_n, knock_s=knock.knock_s)


def test_runs_of_all_methods_meet_conditions_that_no_demonstration_has(small, comparison, monkeypatch):
    bench, made = small[0], []
    monkeypatch.setattr(imitation_data, "parallel_map", lambda _, work, __: made.extend(work) or work)
    record(bench, small[2])
    plan = [*planned_runs(comparison.settings_deg, comparison.runs), *moved_runs(bench, comparison)]
    shown = {run.seed for run, _ in made} | {run.seed for run in nominal_runs(small[2].expected_runs)}
    assert len(shown) == 8
    assert not {run.seed for run, _ in plan} & shown


def test_every_method_has_as_many_trials():
    parameters = committed(TrialParameters, "rival_trials")
    for model in (OURS, *RIVALS):
        own = drawn_methods(model, parameters)
        assert len(own) == parameters.trials
        assert len({one.model_dump_json() for one in own}) == parameters.trials
        assert own == drawn_methods(model, parameters)
        assert type(own[0]) is type(getattr(METHODS, model))


def test_trials_are_made_with_the_parameters_that_they_draw(small, comparison, monkeypatch):
    monkeypatch.setenv(BACKEND, "sequential")
    bench, recorded, _ = small
    options = {name: {key: [its] for key, its in vars(getattr(METHODS, name)).items()} for name in RIVALS}
    for name in RIVALS:
        options[name]["steps"] = [4, 40]
    options["ours"] = {key: [its] for key, its in vars(METHODS.ours).items() if key != "pointwise"}
    options["ours"]["pointwise"] = {key: [its] for key, its in vars(METHODS.ours.pointwise).items()}
    options["ours"]["pointwise"]["dropout"] = [0.0, 0.5]
    drawing = committed(TrialParameters, "rival_trials", trials=2, count=1, settings_deg=(5.0,))
    drawing = drawing.model_copy(update=options)
    results = choose(3, bench, recorded, drawing, comparison.seed)
    for model in (OURS, *RIVALS):
        assert len(results.query("model == @model and quantity == 'failed'")) == 2
        costs = trial_costs(results, model)
        assert costs[0] != costs[1]
    drawing.chunking["steps"] = [4]
    with pytest.raises(InputError, match="trials of chunking: the options do not make 2 different trials"):
        drawn_methods("chunking", drawing)


def test_the_trial_with_the_lowest_geometric_mean_is_the_best():
    rows = [(0, 1.0), (0, 100.0), (1, 4.0), (1, 4.0), (2, 60.0), (2, 1.0)]
    table = pd.DataFrame(rows, columns=["level", "value"]).assign(quantity="cost", model="ours")
    other = table.assign(model="chunking", value=5.0 - table["level"])
    both = pd.concat([table, other])
    assert trial_costs(both, "ours").round(6).to_dict() == {0: 10.0, 1: 4.0, 2: round(60.0**0.5, 6)}
    assert trial_costs(both, "chunking").idxmin() == 2


def test_what_was_chosen_on_tuning_people_is_what_is_compared():
    study = read_study("rivals/choice", ROOT / RESULTS)
    if study is None:
        pytest.skip("no trials were made yet")
    parameters, methods = (
        committed(TrialParameters, "rival_trials"),
        committed(MethodParameters, "rival_methods"),
    )
    for model in (OURS, *RIVALS):
        best = trial_costs(study.results, model).idxmin()
        assert getattr(methods, model) == drawn_methods(model, parameters)[int(best)]


def test_nobody_tuned_on_is_in_the_comparison():
    tuned = set(read_yaml(ROOT / "params.yaml")["scraping_people"]["tuning"])
    people = {seed for cell in planned_cells("rivals/people", ROOT) for seed in seeds_of(cell)}
    choosing = {seed for cell in planned_cells("rivals/choice", ROOT) for seed in seeds_of(cell)}
    longer_trained = {seed for cell in planned_cells("rivals/longer", ROOT) for seed in seeds_of(cell)}
    assert choosing == tuned
    assert len(longer_trained) >= 6
    assert not longer_trained & (people | tuned)
    assert len(people) >= 12
    assert not people & tuned
    assert {"rivals/people", "rivals/choice"} <= read_descriptions(
        ROOT / "stages/studies/studies.yaml"
    ).keys()


@pytest.fixture(scope="module")
def studied():
    """Results of twelve people, by whom rivals cost twice as much as ours, less with more demonstrations."""
    rng, rows = np.random.default_rng(0), []
    comparison = committed(ComparisonParameters, "rivals")
    parts = [
        AS_DEMONSTRATED,
        KNOCKED,
        *(f"{one} {how}" for one in ("start", "goal") for how in ("within", "beyond")),
    ]
    for person, model, part, setting in product(range(11, 23), MODELS, parts, comparison.settings_deg):
        if part != AS_DEMONSTRATED and setting != comparison.moved.setting_deg:
            continue
        for count in (0,) if model == NOMINAL else comparison.counts:
            level = {NOMINAL: 300.0, OURS: 40.0}.get(model, 80.0) * (2.0 if 0 < count < 4 else 1.0)
            values = {
                "cost": level,
                "goal": 0.5 if model == OURS else 3.0,
                "jerk": level,
                "failed": float(level == 80.0),
            }
            keys = {"person": person, "model": model, "part": part, "setting": setting, "level": float(count)}
            for quantity, value in values.items():
                spread = 1.0 if quantity == "failed" else np.exp(0.05 * rng.standard_normal())
                rows.append({"quantity": quantity, "value": value * spread, "unit": ""} | keys)
    return Study(pd.DataFrame(rows).assign(variant="ours", cell="11", stage="rivals_compare"))


@pytest.fixture(scope="module")
def past_spheres():
    """Results of twelve people, by whom rivals hit 6 % more spheres than ours and make larger detours."""
    rng, rows = np.random.default_rng(1), []
    counts, parts = committed(ReachingParameters, "reaching").counts, (NEAR, FAR, UNSEEN)
    for person, model, part in product(range(83, 95), MODELS, parts):
        for count in (0,) if model == NOMINAL else counts:
            hit = {NOMINAL: 0.5, OURS: 0.02}.get(model, 0.08) + 0.01 * rng.random()
            values = {"hit": hit, "failed": hit, "goal": 8.0, "detour": 5.0 if model == OURS else 25.0}
            keys = {"person": person, "model": model, "part": part, "setting": 0.0, "level": float(count)}
            rows += [{"quantity": name, "value": value, "unit": ""} | keys for name, value in values.items()]
    return Study(pd.DataFrame(rows).assign(variant="ours", cell="83", stage="rivals_compare_reaches"))


def longer(study, factor=1.0):
    """The study once more, and with rivals that cost other than before by a factor."""
    again = study.results.assign(variant="longer")
    again["value"] *= np.where(again["model"].isin(RIVALS) & again["quantity"].eq("cost"), factor, 1.0)
    return Study(pd.concat([study.results, again]))


def shown(study, past_spheres, factor=1.0):
    """Their page, with trials of which the number is the cost."""
    board, reaching = (
        committed(TrialParameters, "rival_trials"),
        committed(ReachingTrialParameters, "reaching_trials"),
    )
    rows = [
        {"quantity": quantity, "value": number + 1.0, "level": float(number), "model": model}
        for quantity, model, number in product(("cost", "failed"), MODELS[1:], range(board.trials))
    ]
    tried = Study(pd.DataFrame(rows))
    return page(
        Compared(study, tried, committed(ComparisonParameters, "rivals"), board, LOOKS),
        longer(study, factor),
        Compared(past_spheres, tried, committed(ReachingParameters, "reaching"), reaching, AVOIDING),
    )


def test_the_page_judges_what_it_shows_either_way(studied, past_spheres, tmp_path):
    document, drawn, tables, find = shown(studied, past_spheres)
    verdicts = {one.claim.evidence: one.verdict for one in document.judged}
    assert verdicts["all_demonstrations"] == verdicts["more_failures_beyond"] == "yes"
    assert verdicts["one_against_four"] == "no difference"
    assert verdicts["goal_distance"] == "no"
    assert verdicts["level_harm"] == "yes"
    assert verdicts["longer_training"] == verdicts["more_hits"] == verdicts["more_hits_with_four"] == "yes"
    assert verdicts["reaching_goal"] == "yes"
    assert verdicts["needless_detour"] == "no"
    publish_judged(tmp_path, {"index": document}, drawn, tables, find)
    assert "0.50" in (tmp_path / "index.html").read_text()
    better = studied.results.copy()
    better.loc[better["model"].isin(RIVALS) & (better["quantity"] == "cost"), "value"] /= 4.0
    other = past_spheres.results.copy()
    other.loc[other["model"].isin(RIVALS) & (other["quantity"] == "hit"), "value"] = 0.0
    found = shown(Study(better), Study(other), factor=0.5)[0].judged
    against = {one.claim.evidence: one.verdict for one in found}
    assert against["all_demonstrations"] == against["unseen_tilts"] == against["knocked"] == "no"
    assert against["longer_training"] == "no"
    assert against["more_hits"] == against["more_hits_with_four"] in ("no", "no difference")


def test_the_table_of_trials_says_what_was_drawn_and_chosen(studied, past_spheres):
    tables = shown(studied, past_spheres)[2]
    table = tables["rival_choices"].frame
    assert "displaced_m" in tables["reaching_choices"].frame["drawn"].iloc[0]
    assert list(table[table["note"] == "chosen"]["trial"]) == [0, 0, 0]
    budget = committed(TrialParameters, "rival_trials")
    drawn = drawn_methods("chunking", budget)[1]
    assert f"chunk {drawn.chunk}, " in table["drawn"].iloc[2 * budget.trials + 1]
    assert "batch" not in table["drawn"].iloc[-1]  # has one option


def test_one_recording_has_all_methods_side_by_side(small, tmp_path, monkeypatch):
    monkeypatch.setenv(BACKEND, "sequential")
    bench, recorded, _ = small
    executions = executed_once(bench, recorded, METHODS, 8.8, 1)
    coupling = {one.look.name: np.abs(one.traces["coupling"]).max() for one in executions}
    assert [name for name, most in coupling.items() if most > 0.0] == ["primitives with feedback"]
    publish_recordings(tmp_path / "rerun", {"side_by_side": side_by_side(executions)})
    verify(tmp_path / "rerun/side_by_side.rrd")
    paths = {one.entity_path for one in chunks(tmp_path / "rerun/side_by_side.rrd")}
    for one in executions:
        assert f"/{entity('runs', one.look.name).strip('/')}/hand/electrodes" in paths


def test_a_cell_of_the_study_runs_its_stage(tmp_path):
    """From guided demonstrations to results, with few and small ones of everything."""
    name = "rivals/people"
    for linked in ("stages", "src", "dvc.yaml", "dvc.lock"):
        (tmp_path / linked).symlink_to(ROOT / linked)
    (tmp_path / "reports/quoted").mkdir(parents=True)
    few = {"settings_deg": [5], "runs": 1, "level_runs": 1, "expected_runs": 2}
    changes = {
        "simulate": {"count": 4},
        "rivals": {"demonstrations": few, "counts": [1], "settings_deg": [0], "runs": 1},
        "rival_methods": METHODS.model_dump(mode="json"),
    }
    text = yaml.safe_dump(parameter_tree(changes), sort_keys=False)
    (tmp_path / "params.yaml").write_text(text)
    description = read_descriptions(ROOT / "stages/studies/studies.yaml")[name]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(BACKEND, "sequential")
        results = run_cell(name, description, "3", tmp_path)
    assert set(results["person"]) == {3}
    assert set(results["model"]) >= {OURS, *RIVALS}
    costs = results[results["quantity"] == "cost"]
    assert (costs["value"] > 0.0).all()
    assert len(costs) == 4 * 6  # models by the tilt and five other situations
    assert made_with(name, description, tmp_path).keys() == set(description.parameters)
