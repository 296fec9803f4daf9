"""Runs of motion and their assignment to primitives."""

import runpy
from itertools import pairwise, product

import numpy as np
import pytest
from committed import EXAMPLE_TASK
from conftest import minimum_jerk
from hypothesis import given
from hypothesis import strategies as st

from dissertation.simulation.pick_and_place import SLOW, as_recording, takes, write_takes
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers import Demonstration, read_demonstrations, synchronise
from structlearn.segmentation import find_crossings, run_assignment
from structlearn.segmentation import motion_runs as runs
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.run_assignment import (
    DISPLACED,
    HASTE,
    MISSING,
    PAUSE_PRICE,
    UNASSIGNED_PRICE,
    assign,
)
from structlearn.segmentation.segments import cut, read_segmentation, write_segmentation

TASK = EXAMPLE_TASK
SPEED = np.array([0, 0, 2, 3, 1, 0, 0, 0, 4, 4, 0, 5, 0, 0], dtype=float)


def pick(primitives, **changes) -> SegmentParameters:
    """How the public task is cut, into other primitives."""
    return TASK.segment.model_validate(TASK.segment.model_dump() | {"primitives": primitives} | changes)


def along_a_line(speed: np.ndarray) -> runs.AxisMotion:
    """One axis at a speed, 1 s a sample."""
    path = np.append(0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1])))
    return runs.AxisMotion(path[:, None], np.abs(speed), np.abs(speed), False)


def test_runs_are_where_the_speed_is_above_the_threshold():
    assert runs.runs_of_motion(SPEED, 0.5, 9).tolist() == [[2, 4], [8, 9], [11, 11]]
    assert runs.runs_of_motion(SPEED, 2.5, 9).tolist() == [[3, 3], [8, 9], [11, 11]]
    assert runs.runs_of_motion(SPEED, 0.5, 2).tolist() == [[2, 4], [8, 9]]  # the longest ways: 6 and 8, not 5
    assert runs.runs_of_motion(SPEED, 0.5, 9, breaks=[3, 6]).tolist() == [[2, 2], [3, 4], [8, 9], [11, 11]]
    assert runs.runs_of_motion(SPEED, 9.0, 9).shape == (0, 2)


def test_runs_with_a_short_dip_between_them_are_candidates_alone_and_joined():
    moved = along_a_line(SPEED)
    found = runs.run_candidates(moved, runs.CandidateSearch((0.5,), 1.0, 1, 9))
    assert list(zip(found.first, found.last, found.paused_s, strict=True)) == [
        (1, 5, 0),
        (7, 10, 0),
        (7, 12, 1),
        (10, 12, 0),
    ]  # each cut where it comes to rest
    assert found.duration.tolist() == [5, 4, 6, 3]


def test_a_hand_that_rests_at_the_ends_of_a_recording_does_not_move_there():
    parameters, rng = pick(1), np.random.default_rng(0)
    time = np.arange(0.0, 3.0, 0.01)
    for _ in range(5):
        noisy = Demonstration("01", time, 1e-3 * rng.standard_normal((len(time), 3)))
        speed = runs.motion(noisy, "xyz", parameters).smooth_speed
        assert max(speed[0], speed[-1]) <= speed[20:-20].max()


def by_hand(demonstrations: list[list[runs.Candidates]]) -> float:
    """The cheapest total, by trying every chain in every demonstration."""

    def chains(primitives):
        for chain in product(*(range(len(one.first)) for one in primitives)):
            parts = [(one.first[g], one.last[g]) for one, g in zip(primitives, chain, strict=True)]
            if all(a[1] <= b[0] and a[0] < b[0] for a, b in pairwise(parts)):
                yield chain

    def extra(primitives, chain, way):
        """Price of what is left out and of rests within."""
        one = primitives[0]
        edges = [0, *(end for g in chain for end in (one.first[g], one.last[g])), len(one.path) - 1]
        price = PAUSE_PRICE * sum(one.paused_s[g] for g in chain)
        for since, until in zip(edges[::2], edges[1::2], strict=True):
            gone = one.travelled[until] - one.travelled[since]
            displaced = min(abs(one.path[until, 0] - one.path[since, 0]), gone)
            price += UNASSIGNED_PRICE * (gone + DISPLACED * displaced) / way
        return price

    def mismatch(a, g, b, h):
        moved = a.path[a.last[g]] - a.path[a.first[g]] - (b.path[b.last[h]] - b.path[b.first[h]])
        apart = np.linalg.norm(moved) / (0.5 * (a.path_length[g] + b.path_length[h]))
        return (
            apart
            + HASTE * abs(np.log(a.duration[g] / b.duration[h]))
            + abs(np.log(a.path_length[g] / b.path_length[h]))
        )

    totals = []
    for reference in demonstrations:
        for chain in chains(reference):
            total = extra(reference, chain, reference[0].travelled[-1] / len(reference))
            way = np.mean([one.path_length[g] for one, g in zip(reference, chain, strict=True)])
            for other in demonstrations:
                if other is not reference:
                    costs = [
                        extra(other, its, way)
                        + sum(mismatch(*pair) for pair in zip(reference, chain, other, its, strict=True))
                        for its in chains(other)
                    ]
                    total += min([*costs, MISSING * len(reference)])
            totals.append(total)
    return min(totals, default=np.inf)


def lengths(low: int, high: int):
    return st.lists(st.integers(1, 6), min_size=low, max_size=high)


def candidates(lengths: list[int], bridge: int, number: int = 0) -> runs.Candidates:
    """Of a motion to and fro along a line, by the lengths of its runs."""
    speed = [np.append(np.full(n, n % 3 - 1.5), np.zeros(1 + (n + number) % 4)) for n in lengths]
    moved = along_a_line(np.append(0.0, np.concatenate(speed)))
    return runs.run_candidates(moved, runs.CandidateSearch((0.1, 1.0), 1.0, bridge, 9))


@given(lengths(3, 7), st.integers(1, 3), st.integers(0, 3), st.integers(1, 9))
def test_the_patterns_tried_are_the_cheapest_cuts(moves, primitives, bridge, most):
    cut = [candidates(moves, bridge)] * primitives
    gaps = run_assignment._gaps(cut, [False] * primitives)
    chains, prices = run_assignment._chains(cut, gaps, most)
    every, its = run_assignment._chains(cut, gaps, 10**6)  # none is dropped on the way
    assert prices == pytest.approx(sorted(its)[:most])
    assert {tuple(chain) for chain in chains} <= {tuple(chain) for chain in every}


@given(st.lists(lengths(2, 4), min_size=2, max_size=3), st.integers(1, 2), st.integers(0, 3))
def test_the_assignment_is_the_cheapest_of_all(moves, primitives, bridge):
    demonstrations = [[candidates(own, bridge, number)] * primitives for number, own in enumerate(moves)]
    found = assign(demonstrations, range(len(demonstrations)), [False] * primitives)
    assert (np.inf if found is None else found.total) == pytest.approx(by_hand(demonstrations))


def segmentation_of(made, primitives, **changes):
    return cut([synchronise(as_recording(take), 100.0) for take in made], pick(primitives, **changes))


def errors_s(made, segmentation) -> np.ndarray:
    """(takes, moves, 2) of the cuts against where each move is planned to begin and end."""
    errors = []
    for take in made:
        ends = [table.loc[take.name, ["start_s", "end_s"]] for table in segmentation.results.values()]
        errors.append(np.array(ends, dtype=float) - as_recording(take).true_segments)
    return np.array(errors)


@pytest.mark.parametrize("moves", [2, 3, 5])
def test_moves_in_space_are_told_apart_by_their_order(moves):
    made = takes(3, moves, twitch=True, hesitation=True)
    segmentation = segmentation_of(made, moves)
    errors = np.abs(errors_s(made, segmentation))
    assert errors.mean() < 0.04
    assert errors.max() < 0.15
    assert segmentation.primitives == [f"move_{place + 1}" for place in range(moves)]
    assert segmentation.warnings.empty


def test_a_move_that_is_not_made_is_named_with_the_runs_and_the_thresholds():
    made = takes(2, 3, without={"04": "carry"}, twitch=True)
    names = ["reach", "carry", "retreat"]
    reason = (
        r"04: has \d runs of motion above [\d.]+ m/s \([\d.]+-[\d.]+, .* s\), and .*; tried [\d., ]+ m/s too"
    )
    with pytest.raises(InputError, match=reason):
        segmentation_of(made, names)
    segmentation = segmentation_of(made, names, skip_failures=True)
    assert segmentation.left_out["demonstration"].tolist() == ["04"]
    kept = [take for take in made if take.name != "04"]
    assert np.abs(errors_s(kept, segmentation)).max() < 0.15


def test_of_many_demonstrations_an_even_part_is_tried_as_the_pattern(monkeypatch):
    """So that twice as many cost twice as much; all are cut as before."""
    made = takes(3, 2)
    expected = segmentation_of(made, 2)
    monkeypatch.setattr(run_assignment, "PATTERNS", 3 * run_assignment.FEWEST_PATTERNS)
    chains, tried = run_assignment._chains, []
    monkeypatch.setattr(run_assignment, "_chains", lambda *given: tried.append(1) or chains(*given))
    found = segmentation_of(made, 2)
    assert len(tried) == 3
    assert found.reference in {"01", "03", "05"}
    assert np.abs(errors_s(made, found) - errors_s(made, expected)).max() < 0.05


def test_too_few_primitives_leave_motion_that_is_told_of(tmp_path):
    segmentation = segmentation_of(takes(1, 3), 2)
    assert set(segmentation.warnings["demonstration"]) == {f"0{number + 1}" for number in range(6)}
    assert segmentation.warnings["reason"].str.contains("belongs to no primitive").all()
    write_segmentation(segmentation, tmp_path / "cuts")
    assert read_segmentation(tmp_path / "cuts").warnings.equals(segmentation.warnings)


def test_one_that_can_be_cut_does_not_speak_for_all():
    """Of the others each has a run less: the number is wrong, and nothing of it may be skipped."""
    others = dict.fromkeys(["02", "03", "04"], "carry")
    made = takes(1, 3, 4, without=others)
    with pytest.raises(InputError, match=r"^3 of 4 demonstrations cannot be cut .*skipped: 0\d: has 2 runs"):
        segmentation_of(made, 3, skip_failures=True)


def test_primitives_may_be_a_number_names_or_mappings():
    forms = (2, ["move_1", "move_2"], [{"name": "move_1"}, "move_2"])
    read = [pick(form).primitives for form in forms]
    assert read[0] == read[1] == read[2]
    assert [(one.axis, one.threshold_m_s, one.until) for one in read[0]] == [("xyz", None, None)] * 2


def test_a_gripper_or_a_force_may_end_a_primitive(tmp_path):
    """The fingers close while the hand rests, and it moves on; the wrist feels the part from then on."""
    made, names = takes(6, 3, 3), ("reach", "carry", "retreat")
    write_takes(made, tmp_path)
    topics = TASK.topics.model_dump() | {
        "joint_states": ["/joint_states", "/gripper/joint_states"],
        "joints": ["panda_joint1", "panda_finger_joint1"],
    }
    demonstrations = read_demonstrations(tmp_path, TASK.topics.model_validate(topics), 100.0)
    for until in ({"signal": "panda_finger_joint1", "below": 0.02}, {"signal": "force", "above": 3.0}):
        segmentation = cut(demonstrations, pick([{"name": "reach", "until": until}, "carry", "retreat"]))
        for take in made:
            closed = take.time[np.argmax(take.opening < 0.02 if "below" in until else take.load > 0)]
            for method in ("zvc", "wls"):
                found = segmentation.result("reach", method).loc[take.name, "end_s"]
                assert found == pytest.approx(closed, abs=0.05)
    for name, signal, above, message in (
        ("reach", "force", 99.0, "primitive 'reach': force never comes to above 99 after its motion"),
        ("carry", "force", 3.0, r"in this order; force comes to above 3 at [\d.]+ s; tried"),
        ("reach", "thumb", 99.0, r"01: no 'thumb' was recorded .* joints: panda_joint1"),
    ):
        until = {"name": name, "until": {"signal": signal, "above": above}}
        with pytest.raises(InputError, match=message):
            cut(demonstrations, pick([until if one == name else one for one in names]))


def test_an_event_within_a_run_ends_it():
    """Who presses on without a rest has still come to another primitive."""
    time = np.arange(0.0, 3.0, 0.01)
    ways = minimum_jerk((time - 0.5) / 2.0)
    demonstrations = [
        Demonstration(
            name,
            time,
            scale * ways[:, None] * [0.0, 0.0, -0.2],
            wrench=np.outer(10.0 * (ways > 0.6), np.ones(6)),
        )
        for name, scale in (("01", 1.0), ("02", 1.1))
    ]
    primitives = [{"name": "approach", "until": {"signal": "force", "above": 5.0}}, "press"]
    segmentation = cut(demonstrations, pick(primitives))
    contact = time[np.argmax(ways > 0.6)]
    np.testing.assert_allclose(segmentation.result("approach")["end_s"], contact, atol=1e-9)
    np.testing.assert_allclose(segmentation.result("press")["start_s"], contact, atol=1e-9)


def test_sway_of_a_slow_hand_is_no_motion_that_bounds_a_move():
    """It is faster than the lowest threshold, but what surrounds a move never begins within it."""
    made = takes(2, 3, 3, hand=SLOW)
    demonstrations = [synchronise(as_recording(take), 200.0) for take in made]
    _, crossings = find_crossings(demonstrations, pick(3))
    for one, found in zip(demonstrations, crossings, strict=True):
        for (start, end), crossing in zip(one.true_segments / one.dt, found.values(), strict=True):
            assert crossing.earliest < start
            assert crossing.latest > end


@pytest.mark.parametrize("seed", [1, 2])
def test_wiping_without_a_rest_is_cut_at_contact(root, monkeypatch, seed):
    """To and fro, where every stroke comes to a halt, or in circles: only the force tells where it begins."""
    monkeypatch.syspath_prepend(root / "benchmarks")  # what it imports of the others
    benchmark = runpy.run_path(str(root / "benchmarks/example_cuts.py"))
    assert benchmark["of_wiping"](seed, "onset")["error_ms"].max() < 50.0


def test_a_turn_on_the_spot_is_found_by_its_angular_speed():
    """Reach, turn by 2 rad more than once around, and back, with rests between them."""
    demonstrations, true = [], []
    for number, stretch in enumerate([1.0, 1.2, 0.9]):
        starts = stretch * np.array([0.5, 2.1, 4.0])
        ends = starts + stretch * np.array([1.2, 1.5, 1.2])
        time = np.arange(0.0, ends[-1] + 0.5, 0.01)
        there, turned, back = (
            minimum_jerk((time - start) / (end - start)) for start, end in zip(starts, ends, strict=True)
        )
        demonstrations.append(
            Demonstration(
                f"{number + 1:02d}",
                time,
                0.3 * (there - back)[:, None] * [1.0, 0.5, 0.0],
                quaternion.from_rotation_vector(8.3 * turned[:, None] * [0.0, 0.0, 1.0]),
            )
        )
        true.append(np.stack([starts, ends], axis=1))
    segmentation = cut(demonstrations, pick(["reach", {"name": "turn", "axis": "rot"}, "back"]))
    for place, name in enumerate(["reach", "turn", "back"]):
        found = segmentation.result(name)[["start_s", "end_s"]].to_numpy(float)
        np.testing.assert_allclose(found, np.array(true)[:, place], atol=0.1)
    unassigned = cut(demonstrations, pick(["reach", "back"])).warnings
    assert set(unassigned["demonstration"]) == {"01", "02", "03"}
    assert set(unassigned["reason"]) == {"rotation before it belongs to no primitive (degrees)"}
    between = cut(demonstrations, pick(["reach", {"name": "turn", "axis": "between"}, "back"]))
    assert len(between.warnings) == 0
