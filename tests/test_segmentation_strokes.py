"""Strokes whose number varies between demonstrations are one primitive, cut and learned from all of them."""

import numpy as np
import pytest
from own_skills import FIT

from dissertation.simulation import wiping
from dissertation.simulation.pick_and_place import as_recording
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.primitives.fitting import cross_validation, learn_sequence
from structlearn.primitives.sequence import unroll
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.motion_runs import motion
from structlearn.segmentation.segments import cut, read_segmentation, write_segmentation
from structlearn.segmentation.strokes import find_strokes
from structlearn.tasks.movement.parameters import TaskSegmentParameters

RATE_HZ = 100.0
SEGMENT = TaskSegmentParameters(
    primitives=("reach", {"name": "wipe", "axis": "strokes"}, "retreat"),
    reference=None,
    guess_cutoff_hz=4.0,
    cut_cutoff_hz=4.0,
    align_cutoff_hz=5.0,
    bridge_s=0.5,
    extension_s=0.5,
    downsampling=2,
    near_zero=0.1,
    decay=1.0,
    crossing_weight=8.0,
    crossing_tolerance_s=0.5,
    skip_failures=False,
    ends="onset",
)


def wiped(seed: int = 1, pause_s: tuple[float, float] = (0.0, 0.0)) -> list[Demonstration]:
    return [synchronise(as_recording(take), 200.0, 0.2) for take in wiping.takes(seed, 6, pause_s)]


@pytest.mark.parametrize("pause_s", [(0.0, 0.0), (0.3, 0.8)])
def test_three_to_five_strokes_are_cut_and_learned_from_all_demonstrations(pause_s):
    runs = wiped(pause_s=pause_s)
    found = cut(runs, SEGMENT)
    assert len(found.left_out) == len(found.warnings) == 0
    for place, table in enumerate(found.results.values()):
        true = np.array([run.true_segments[place] for run in runs])
        assert np.abs(table[["start_s", "end_s"]].to_numpy() - true).max() < 0.040
    numbers = found.strokes.groupby("demonstration")["cycle"].agg(np.ptp)
    expected = np.array([1.5, 2.0, 2.5] * 2) - (0.0 if pause_s == (0.0, 0.0) else 0.21)
    np.testing.assert_allclose(numbers, expected, atol=0.03)
    errors = cross_validation(runs, found.results, FIT).query("left_out and regression == 'joint'")
    assert errors.groupby("primitive")["mean_mm"].mean().max() < 3.0
    wipe = learn_sequence(runs, found.results, FIT)[1]
    assert wipe.rhythm is not None
    assert wipe.duration / wipe.rhythm.cycles == pytest.approx(1.8 if pause_s == (0.0, 0.0) else 2.9, rel=0.1)


def test_the_sequence_moves_on_from_either_side():
    runs = wiped()
    primitives = learn_sequence(runs, cut(runs, SEGMENT).results, FIT)
    for cycles in (2.0, 3.5):
        chosen = [primitives[0], primitives[1].repeated(cycles), primitives[2]]
        path = unroll(chosen, 0.005)
        start, end = path.position.position[path.switches[1:3]]
        np.testing.assert_allclose(end - start, cycles % 1.0 * 2.0 * wiping.STROKE, atol=0.01)
        jump = np.abs(np.diff(path.position.acceleration, axis=0)).max()
        assert jump < 0.1 * np.abs(path.position.acceleration).max()


def test_tables_keep_the_strokes(tmp_path):
    runs = wiped()[:3]
    found = cut(runs, SEGMENT)
    write_segmentation(found, tmp_path / "segments")
    again = read_segmentation(tmp_path / "segments")
    np.testing.assert_array_equal(again.results["wipe"]["knots"]["02"], found.results["wipe"]["knots"]["02"])


def hand(moves, rng: np.random.Generator, name: str, rest_s: float = 0.7) -> Demonstration:
    """Moves (goal, seconds, rest afterwards), or paths (function of the fraction, seconds, rest)."""
    position = [np.tile([0.4, 0.0, 0.4], (round(rest_s * RATE_HZ), 1))]
    for goal, seconds, rest in moves:
        s, start = np.linspace(0.0, 1.0, round(seconds * RATE_HZ) + 1)[1:, None], position[-1][-1]
        way = goal(s) if callable(goal) else minimum_jerk(s) * (np.array(goal) - start)
        rests = np.zeros((round(rest * RATE_HZ), 3))
        position.append(np.concatenate([start + way, start + way[-1] + rests]))
    path = np.concatenate(position)
    return Demonstration(name, np.arange(len(path)) / RATE_HZ, path + 2e-4 * rng.standard_normal(path.shape))


def circles(number: float, radius: float = 0.06):
    """Rounds from and to rest, anticlockwise from the circle's left end."""

    def path(s: np.ndarray) -> np.ndarray:
        angle = 2.0 * np.pi * number * np.interp(s, *eased(0.25 / number))
        return radius * np.hstack([1.0 - np.cos(angle), -np.sin(angle), 0.0 * s])

    return path


def eased(ramp: float) -> tuple[np.ndarray, np.ndarray]:
    """Fractions of the time and of the path, with a `ramp` at both ends."""
    s = np.linspace(0.0, 1.0, 2001)
    speed = minimum_jerk(np.clip(np.minimum(s, 1.0 - s) / ramp, 0.0, 1.0))
    return s, np.cumsum(speed) / speed.sum()


def stirred(numbers=(3.0, 4.0, 5.0), seed: int = 1) -> list[Demonstration]:
    rng = np.random.default_rng(seed)
    return [
        hand(
            [([0.5, -0.1, 0.2], 1.3, 0.5), (circles(number), 1.2 * number, 0.5), ([0.4, 0, 0.4], 1.4, 0.7)],
            rng,
            f"{place:02d}",
        )
        for place, number in enumerate(numbers, 1)
    ]


def test_round_and_round_is_rhythmic_too():
    runs = stirred()
    found = cut(runs, SEGMENT)
    assert len(found.warnings) == 0
    numbers = found.strokes.groupby("demonstration")["cycle"].agg(np.ptp)
    np.testing.assert_allclose(numbers, [3.0, 4.0, 5.0], atol=0.05)
    errors = cross_validation(runs, found.results, FIT).query("left_out and regression == 'joint'")
    assert errors.groupby("primitive")["mean_mm"].mean()["wipe"] < 3.0


def to_and_fro(number: int, seconds: float = 0.9, back: bool = False, length: float = 0.2):
    """Reach to a side, strokes, retreat."""
    sides = [(0.5, -length / 2, 0.12), (0.5, length / 2, 0.12)]
    sides = sides[::-1] if back else sides
    strokes = [(sides[(place + 1) % 2], seconds, 0.0) for place in range(number)]
    return [(sides[0], 1.2, 0.6), *strokes[:-1], (*strokes[-1][:2], 0.6), ((0.4, 0.0, 0.4), 1.3, 0.7)]


def made(*moves) -> list[Demonstration]:
    rng = np.random.default_rng(2)
    return [hand(own, rng, f"{place:02d}") for place, own in enumerate(moves, 1)]


def test_strokes_may_start_on_either_side():
    runs = made(to_and_fro(3), to_and_fro(4, back=True), to_and_fro(5), to_and_fro(2, back=True))
    found = cut(runs, SEGMENT)
    assert len(found.warnings) == 0
    starts = found.strokes.groupby("demonstration")["cycle"].min()
    assert abs(starts["01"] - starts["02"]) == pytest.approx(0.5)
    errors = cross_validation(runs, found.results, FIT).query("left_out and regression == 'joint'")
    assert errors.groupby("primitive")["mean_mm"].mean()["wipe"] < 3.0


@pytest.mark.parametrize("seconds", [0.3, 2.5])
def test_many_quick_or_few_slow_strokes(seconds):
    runs = made(*(to_and_fro(number, seconds) for number in ((14, 21, 25) if seconds < 1.0 else (2, 3, 4))))
    found = cut(runs, SEGMENT)
    numbers = found.strokes.groupby("demonstration")["cycle"].agg(np.ptp)
    np.testing.assert_allclose(2 * numbers, [14, 21, 25] if seconds < 1.0 else [2, 3, 4], atol=0.2)


def test_bad_strokes_are_refused_in_one_line():
    with pytest.raises(InputError, match="01: primitive 'wipe': its motion has fewer than two strokes"):
        cut(made(to_and_fro(1), to_and_fro(1)), SEGMENT)
    few = made(to_and_fro(3), to_and_fro(1), to_and_fro(4))
    with pytest.raises(InputError, match="02: primitive 'wipe': its motion has fewer than two strokes"):
        cut(few, SEGMENT)
    assert cut(few, SEGMENT.model_copy(update={"skip_failures": True})).left_out[
        "demonstration"
    ].tolist() == ["02"]
    slow = made(to_and_fro(3), to_and_fro(4), to_and_fro(3, seconds=2.5))
    with pytest.raises(
        InputError, match=r"03: its period of \d.\d\d s and that of 0\d, 1.8\d s, differ by more than"
    ):
        cut(slow, SEGMENT)


def test_a_run_says_whether_it_is_strokes():
    run, single = made(to_and_fro(5), to_and_fro(1))
    moved = motion(run, "strokes", SEGMENT)
    (strokes,) = find_strokes(moved, 0.02)
    assert strokes.number == 5
    assert 2 * strokes.samples / RATE_HZ == pytest.approx(1.8, abs=0.05)
    assert find_strokes(motion(single, "strokes", SEGMENT), 0.02) == []
