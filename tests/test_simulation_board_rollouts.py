"""Rollouts on the simulated board: judged, repeatable, and never the end of a search."""

from dataclasses import replace

import numpy as np
import pytest
from board_rollouts import LIMITS, POLICY, RATE_HZ, SEED, TESTBED, same, small_board
from committed import committed
from feedback_toy import toy_dataset
from parallel_work import Deadly
from scraping_motions import CHANNELS, DURATIONS_S, NAMES, constant_network, scraping_skill

from dissertation.scraping.protocol import board_refinement
from dissertation.scraping.protocol.execution_scores import nominal_orientation
from dissertation.scraping.protocol.executions import (
    evaluation_runs,
    execute_run,
    nominal_runs,
    runs_to_correct,
)
from dissertation.scraping.world.execution import ControlParameters
from structlearn.core.artefacts import write_table
from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.skill import largest_coupling
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.readers import synchronise
from structlearn.readers.demonstration import read_runs, write_runs
from structlearn.readers.source import ClockParameters


@pytest.fixture(scope="module")
def board():
    return small_board()


@pytest.fixture(scope="module")
def runs(board):
    """Of a policy and of one that does nothing, under equal conditions."""
    return board.rollouts([open_loop(POLICY), open_loop(np.zeros(25))], [SEED, SEED])


def test_the_cost_is_how_far_the_tool_is_off_at_every_tick_of_the_primitive(runs):
    """Without feedback the tool stays upright on the tilted board."""
    for run in runs:
        assert run.fault == ""
        assert len(run.cost) == pytest.approx(DURATIONS_S[1] * RATE_HZ, abs=2)
        assert (run.cost >= 0.0).all()
    done, idle = runs
    assert np.degrees(idle.cost).mean() == pytest.approx(5.0, abs=0.5)
    assert done.cost.sum() < 0.8 * idle.cost.sum()  # this policy turns the right way


def test_samples_say_what_the_policy_did(runs):
    """The target is what the policy added, behind the low-passes of supervision."""
    done, idle = (run.samples for run in runs)
    for samples in (done, idle):
        assert samples.deviation.shape == (len(samples.target), CHANNELS)
        assert (samples.setting == 5.0).all()
        assert samples.time[0] == 0.0
        assert samples.time[-1] == pytest.approx(DURATIONS_S[1], abs=0.02)
        np.testing.assert_allclose(np.diff(samples.time), 0.01, atol=1e-9)
    wanted = done.modulation() @ POLICY
    assert np.abs(wanted).max() < LIMITS.largest_coupling["ry"]
    assert np.corrcoef(done.target, wanted)[0, 1] > 0.9
    assert np.abs(done.target - wanted).mean() < 0.2 * np.abs(wanted).max()
    assert np.abs(idle.target).mean() < 0.1 * np.abs(wanted).max()
    assert not np.array_equal(done.deviation, idle.deviation)  # what the policy does is felt


@pytest.fixture
def executing(monkeypatch):
    """Puts another function in the place of the one that executes runs."""
    return lambda other: monkeypatch.setattr(board_refinement, "execute_run", other)


@pytest.fixture
def asked(executing):
    """The arguments of every execution; nothing is executed."""
    calls = []

    def remember(*arguments):
        calls.append(arguments)
        raise ValueError("only looked at")

    executing(remember)
    return calls


def test_only_the_primitives_up_to_the_refined_one_are_executed(board, asked):
    before = constant_network(5.0)
    refined = replace(board, preceding={"turn": before}, name="scrape")
    for one, names in ((board, NAMES[:2]), (refined, NAMES)):
        asked.clear()
        network = open_loop(POLICY)
        one.rollouts([network], [SEED])
        ((run, _, skill, testbed),) = asked
        assert tuple(primitive.name for primitive in skill.primitives) == names
        assert tuple(skill.expected) == names
        assert skill.networks[names[-1]]["ry"] is network
        assert run.feedback
        assert not run.corrected
        assert run.setting_deg == 5.0
        assert (testbed, skill.limits) == (TESTBED, LIMITS)
    assert skill.networks["turn"]["ry"] is before


def test_seeds_meet_no_other_runs_and_tell_primitives_apart(board, asked):
    seeds = [(iteration, kind, n) for iteration in range(3) for kind in range(3) for n in range(4)]
    for name in NAMES[1:]:
        replace(board, name=name).rollouts([open_loop(POLICY)] * len(seeds), seeds)
    found = [run.seed for run, *_ in asked]
    assert len(set(found)) == len(found) == 2 * len(seeds)
    settings = [0.0, 2.5, 5.0, 6.3, 10.0, -2.5]
    others = [*nominal_runs(15), *runs_to_correct(settings, 15), *evaluation_runs(settings, 8, False)]
    assert len({run.seed for run in others}) == len(others) == 15 + 15 * 6 + 8 * 6
    assert board_refinement.REFINED not in {run.seed[0] for run in others}


def assert_failed(run, fault):
    assert fault in run.fault
    assert run.samples is None
    assert len(run.cost) > 0
    assert np.isnan(run.cost).all()


def test_a_network_that_is_no_number_fails_alone(board, runs):
    broken, good = board.rollouts([open_loop(np.full(25, np.nan)), open_loop(POLICY)], [SEED, SEED])
    assert_failed(broken, "InputError: the network of 'turn' for ry holds a value that is not finite")
    assert same(good, runs[0])


@pytest.mark.parametrize("stiffness", [1e5, 1e9, 1e300])
def test_a_robot_that_diverges_fails(board, stiffness):
    """By where the tool is, or by signals that are not finite."""
    control = committed(ControlParameters, "testbed.control", stiffness=stiffness)
    unstable = replace(board, testbed=TESTBED.model_copy(update={"control": control}))
    (run,) = unstable.rollouts([open_loop(POLICY)], [SEED])
    assert_failed(run, "has diverged")


@pytest.mark.parametrize("kind", ["pose", "tool_to_board", "tactile"])
def test_a_signal_that_is_not_finite_fails(board, kind, executing):
    def diverging(*arguments):
        recording = execute_run(*arguments)
        streams = []
        for stream in recording.streams:
            values = stream.values.copy()
            if stream.kind == kind:
                values[len(values) // 2 :] = np.nan
            streams.append(replace(stream, values=values))
        return replace(recording, streams=tuple(streams))

    executing(diverging)
    (run,) = board.rollouts([open_loop(POLICY)], [SEED])
    assert_failed(run, "InputError: ")


FAULTS = (ValueError, FloatingPointError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError)
BUGS = (TypeError, KeyError, AttributeError, MemoryError, KeyboardInterrupt)


@pytest.mark.parametrize("error", [*FAULTS, *BUGS])
def test_what_a_diverging_run_raises_is_a_fault_but_errors_of_the_program_are_not_hidden(
    board, error, executing
):
    def fail(*arguments):
        raise error("no joint angles reach there")

    executing(fail)
    if error in BUGS:
        with pytest.raises(error, match="no joint angles"):
            board.rollouts([open_loop(POLICY)], [SEED])
    else:
        (run,) = board.rollouts([open_loop(POLICY)], [SEED])
        assert_failed(run, f"{error.__name__}: no joint angles reach there")


def test_a_rollout_whose_process_dies_is_left_out_alone(board, runs, monkeypatch):
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "fork")
    alive, dead, also_alive = board.rollouts([open_loop(POLICY), Deadly(), open_loop(POLICY)], [SEED] * 3)
    assert_failed(dead, "the process died")
    assert same(alive, runs[0])
    assert same(also_alive, runs[0])


CLOCK = committed(ClockParameters, "clock", rate_hz=RATE_HZ)


@pytest.fixture
def data(board, tmp_path):
    """What the stages before have written, with toy demonstrations of 0, 5 and 10 degrees."""
    write_primitives(board.skill.primitives, tmp_path / "primitives/scraping/primitives.safetensors")
    for name, expected in board.skill.expected.items():
        write_vector_primitive(
            expected, tmp_path / f"feedback/scraping/expected/{name}.safetensors", "traces"
        )
    runs = [execute_run(run, 0, scraping_skill(), board.testbed) for run in nominal_runs(1)]
    clocked = [synchronise(run, **CLOCK.model_dump()) for run in runs]
    write_runs(clocked, tmp_path / "runs/scraping/unrolls.parquet")
    write_table(to_table(toy_dataset()), tmp_path / "feedback/scraping/dataset/turn.parquet")
    return tmp_path


@pytest.mark.parametrize("settings", [(5.0, 10.0), (0.0,)])
def test_the_board_is_read_with_the_demonstrations_of_the_settings_asked_for(data, board, settings):
    """What is not learned from does not bound the feedback."""
    parameters = committed(
        board_refinement.BoardRefinementParameters, "refine", settings_deg=settings, setting_deg=20.0
    )
    found, datasets = board_refinement.read_board(data, parameters, board.supervision, board.testbed, CLOCK)
    assert (found.name, found.setting_deg, found.preceding) == ("turn", 20.0, {})
    assert [one.name for one in found.skill.primitives] == list(NAMES)
    assert found.skill.expected.keys() == board.skill.expected.keys()
    assert set(datasets["turn"].setting) == set(settings)
    assert found.skill.limits.largest_coupling == {"ry": largest_coupling([datasets["turn"].target])}
    unrolls = read_runs(data / "runs/scraping/unrolls.parquet")
    np.testing.assert_array_equal(found.nominal, nominal_orientation(unrolls))
