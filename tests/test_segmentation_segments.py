from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from committed import committed
from pydantic import ValidationError

from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError
from structlearn.core.parallel import BACKEND, PROCESSES
from structlearn.primitives import fitting
from structlearn.segmentation.alignment import METHODS
from structlearn.segmentation.cut_errors import cut_errors
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut, execution_cuts, read_segmentation, write_segmentation

PRIMITIVES = (
    {"name": "down", "axis": "z", "threshold_m_s": 0.01},
    {"name": "turn", "axis": "between", "threshold_m_s": None},
    {"name": "scrape", "axis": "y", "threshold_m_s": 0.01},
)


def parameters(**changes) -> SegmentParameters:
    quick = {"guess_cutoff_hz": 5.0, "cut_cutoff_hz": 20.0, "align_cutoff_hz": 5.0, "extension_s": 0.2}
    return committed(
        SegmentParameters, "segment", primitives=PRIMITIVES, crossing_weight=3.0, **quick | changes
    )


@pytest.fixture(scope="module")
def segmentation(two_move_demonstrations):
    return cut(two_move_demonstrations, parameters())


@pytest.mark.parametrize("backend", ["fork", "sequential"])
def test_processes_do_not_change_the_cuts(two_move_demonstrations, segmentation, backend, monkeypatch):
    monkeypatch.setenv(BACKEND, backend)
    monkeypatch.setenv(PROCESSES, "2")
    found = cut(two_move_demonstrations, parameters())
    for name in ("cuts", "pairs", "left_out", "warnings"):
        pd.testing.assert_frame_equal(getattr(found, name), getattr(segmentation, name), check_exact=True)


def test_known_cut_points_are_found(two_move_demonstrations, segmentation):
    errors = cut_errors(two_move_demonstrations, segmentation)
    wls = errors[errors["method"] == "wls"][["start_error_s", "end_error_s"]].abs()
    assert len(wls) == 2 * 4  # two primitives with an axis; the reference is not guessed
    assert wls.to_numpy().max() < 0.15  # a minimum-jerk movement starts invisibly


def test_stretched_copies_align_exactly(two_move_demonstrations, segmentation):
    """Equation IV.15 holds for stretched copies, so all cuts fall on the same fraction of it."""
    for primitive, place in (("down", 0), ("scrape", 2)):
        cuts = segmentation.result(primitive, "wls_published")
        for demonstration in two_move_demonstrations:
            start, end = demonstration.true_segments[place]
            found = cuts.loc[demonstration.name, ["start_s", "end_s"]].to_numpy(dtype=float)
            fractions = (found - start) / (end - start)
            if demonstration.name == segmentation.reference:
                expected = fractions
            np.testing.assert_allclose(fractions, expected, atol=0.04)


def test_the_turn_is_what_lies_between(segmentation):
    for method in METHODS:
        down, turn, scrape = (segmentation.result(name, method) for name in ("down", "turn", "scrape"))
        np.testing.assert_array_equal(turn["start_s"], down["end_s"])
        np.testing.assert_array_equal(turn["end_s"], scrape["start_s"])


@pytest.mark.parametrize("primitive", ["down", "scrape"])
def test_the_rest_on_both_sides_is_aligned_too(segmentation, primitive):
    """Line 11 of algorithm IV.1: the crossings may be wrong, so both ends reach further by the extension."""
    start, end = segmentation.result(primitive, "zvc").loc["01", ["start_s", "end_s"]]
    for _, pairs in segmentation.pairs.query("primitive == @primitive").groupby("demonstration"):
        assert pairs["reference_s"].min() < start - 0.1
        assert pairs["reference_s"].max() > end + 0.1


def test_reference_may_be_chosen(two_move_demonstrations):
    segmentation = cut(two_move_demonstrations, parameters(reference="03"))
    assert segmentation.reference == "03"
    assert "03" not in set(segmentation.pairs["demonstration"])


def motionless(demonstrations):
    still = replace(demonstrations[1], position=demonstrations[1].position * [1, 0, 1])
    return [demonstrations[0], still, *demonstrations[2:]]


def test_failures_are_left_out_when_that_is_allowed(two_move_demonstrations):
    segmentation = cut(motionless(two_move_demonstrations), parameters(skip_failures=True))
    assert segmentation.left_out["demonstration"].tolist() == ["02"]
    assert "never exceeds" in segmentation.left_out["reason"][0]
    assert "02" not in set(segmentation.cuts["demonstration"])


@pytest.mark.parametrize(
    ("change", "changes", "message"),
    [
        (list, {"reference": "99"}, "no demonstration named '99'"),
        (motionless, {}, r"02: primitive 'scrape': its speed never exceeds 0\.01 m/s"),
        (  # a bad reference is never skipped
            lambda all: [replace(all[0], position=0 * all[0].position), *all[1:]],
            {"skip_failures": True},
            "01: primitive 'down'",
        ),
        (
            lambda all: [all[0], replace(all[1], time=2 * all[1].time)],
            {},
            r"02: sampling interval 0\.02 s differs from 0\.01 s",
        ),
    ],
)
def test_what_cannot_be_cut_is_named(two_move_demonstrations, change, changes, message):
    with pytest.raises(InputError, match=message):
        cut(change(two_move_demonstrations), parameters(**changes))


def test_round_trip(segmentation, tmp_path):
    write_segmentation(segmentation, tmp_path / "cuts")
    read = read_segmentation(tmp_path / "cuts")
    assert read.reference == segmentation.reference
    assert read.primitives == ["down", "turn", "scrape"]
    assert read.cuts.equals(segmentation.cuts)
    assert read.pairs.equals(segmentation.pairs)
    (tmp_path / "cuts/reference.parquet").write_bytes((tmp_path / "cuts/warnings.parquet").read_bytes())
    with pytest.raises(InputError, match=r"reference\.parquet: has no column reference: another table"):
        read_segmentation(tmp_path / "cuts")
    write_table(pd.DataFrame({"reference": pd.Series(dtype=str)}), tmp_path / "cuts/reference.parquet")
    with pytest.raises(InputError, match=r"reference\.parquet: has 0 rows, not one"):
        read_segmentation(tmp_path / "cuts")


@pytest.mark.parametrize(
    ("primitives", "reason"),
    [
        (({"name": "a", "axis": "between", "threshold_m_s": None}, PRIMITIVES[0]), "neighbour"),
        ((PRIMITIVES[0], PRIMITIVES[0]), "must differ"),
        (({"name": "a", "axis": "rot", "threshold_m_s": 0.1},), "must be null for the axis rot"),
        (({"name": "a", "axis": "z", "until": {"signal": "force"}},), "either `above` or `below`"),
    ],
)
def test_bad_primitives_are_refused(primitives, reason):
    with pytest.raises(ValidationError, match=reason):
        committed(SegmentParameters, "segment", primitives=primitives)


NAMES = ("down", "turn", "scrape")
CUTTING = parameters()


def unknown(runs, known=0):
    """The same runs as of a robot that says only of some primitives when they switched."""
    return [replace(run, true_segments=run.true_segments[:known] if known else None) for run in runs]


@pytest.mark.parametrize(("known", "off_s"), [(3, 0.0), (0, 0.15), (2, 0.15)])
def test_segments_are_those_commanded_or_else_cut(two_move_demonstrations, known, off_s):
    """Two commanded primitives cannot be the three that are asked for."""
    cuts = execution_cuts(unknown(two_move_demonstrations, known), NAMES, CUTTING)
    assert list(cuts) == list(NAMES)
    for place, (name, table) in enumerate(cuts.items()):
        assert (table.index.name, list(table.columns)) == ("demonstration", ["start_s", "end_s"])
        for run in two_move_demonstrations:
            np.testing.assert_allclose(cuts[name].loc[run.name], run.true_segments[place], 0, off_s)


def test_one_run_without_them_or_a_reference_elsewhere_and_all_are_cut_alike(two_move_demonstrations):
    runs = unknown(two_move_demonstrations)
    elsewhere = CUTTING.model_copy(update={"reference": "guided_by_hand_3"})
    alike = execution_cuts(runs, NAMES, CUTTING)
    for given, parameters in (([*two_move_demonstrations[:-1], runs[-1]], CUTTING), (runs, elsewhere)):
        for name, table in execution_cuts(given, NAMES, parameters).items():
            np.testing.assert_array_equal(table, alike[name])


def test_a_run_that_cannot_be_cut_is_named(two_move_demonstrations):
    """Also where demonstrations may be left out: everything that is learned needs every run."""
    runs = motionless(unknown(two_move_demonstrations))
    with pytest.raises(InputError, match="02: primitive 'scrape'"):
        execution_cuts(runs, NAMES, parameters(skip_failures=True))


FIT = committed(fitting.FitParameters, "fit_primitives", smoothing_hz=8.0)


def test_neighbouring_segments_agree_at_the_cut(two_move_demonstrations, segmentation):
    down, turn = (
        fitting.segment_paths(two_move_demonstrations, segmentation.result(name), 8.0)
        for name in ("down", "turn")
    )
    for (position, _), (after, _) in zip(down, turn, strict=True):
        np.testing.assert_array_equal(position.acceleration[-1], after.acceleration[0])


def test_learned_primitives_reproduce_the_demonstrations(two_move_demonstrations, segmentation):
    for name in segmentation.primitives:
        segments = fitting.segment_paths(two_move_demonstrations, segmentation.result(name), 8.0)
        errors = fitting.reproduction_errors(fitting.learn_primitive(name, segments, FIT), segments)
        assert errors["mean_mm"].max() < 1.0
        assert errors["mean_deg"].max() < 1.0


def test_mixed_and_empty_segments_are_told(two_move_demonstrations, segmentation):
    mixed = [replace(two_move_demonstrations[0], orientation=None), *two_move_demonstrations[1:]]
    with pytest.raises(InputError, match="some have none"):
        fitting.segment_paths(mixed, segmentation.result("down"), 8.0)
    empty = segmentation.result("down").copy()
    empty.loc["02", "end_s"] = empty.loc["02", "start_s"]
    with pytest.raises(InputError, match="02: a segment has fewer than three samples"):
        fitting.segment_paths(two_move_demonstrations, empty, 8.0)


def test_errors_are_normalised_by_the_variance_about_each_axis_own_mean(
    two_move_demonstrations, segmentation
):
    """How far the task is from the origin of the base frame does not matter."""
    segments = fitting.segment_paths(two_move_demonstrations, segmentation.result("down"), 8.0)
    primitive = fitting.learn_primitive("down", segments, FIT)
    found = fitting.reproduction_errors(primitive, segments)["nmse"]
    for nmse, (path, _) in zip(found, segments, strict=True):
        unrolled = primitive.position.unroll(path.dt, path.position[0], path.position[-1], path.duration)
        squares = np.sum((unrolled.position - path.position) ** 2, axis=0).sum()
        assert nmse == pytest.approx(squares / (len(path.position) * path.position.var(axis=0).sum()))
