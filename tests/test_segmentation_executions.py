from dataclasses import replace

import numpy as np
import pytest
from committed import committed

from structlearn.ground.errors import InputError
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import execution_cuts

NAMES = ("down", "turn", "forward")
CUTTING = committed(
    SegmentParameters,
    "segment",
    primitives=(
        {"name": "down", "axis": "z", "threshold_m_s": 0.02},
        {"name": "turn", "axis": "between", "threshold_m_s": None},
        {"name": "forward", "axis": "y", "threshold_m_s": 0.01},
    ),
    guess_cutoff_hz=4.0,
    cut_cutoff_hz=5.0,
    align_cutoff_hz=5.0,
    extension_s=0.3,
    downsampling=2,
)


def unknown(runs):
    """The same runs as a robot records them that does not say when its primitives switched."""
    return [replace(run, true_segments=None) for run in runs]


@pytest.mark.parametrize("parameters", [None, CUTTING])
def test_commanded_segments_are_taken_as_they_are(two_move_demonstrations, parameters):
    cuts = execution_cuts(two_move_demonstrations, NAMES, parameters)
    assert list(cuts) == list(NAMES)
    for place, name in enumerate(NAMES):
        assert cuts[name].index.name == "demonstration"
        for run in two_move_demonstrations:
            found = cuts[name].loc[run.name, ["start_s", "end_s"]]
            np.testing.assert_array_equal(found, run.true_segments[place])


def test_runs_without_them_are_cut_as_demonstrations_are(two_move_demonstrations):
    cuts = execution_cuts(unknown(two_move_demonstrations), NAMES, CUTTING)
    assert list(cuts) == list(NAMES)
    for place, name in enumerate(NAMES):
        assert list(cuts[name].columns) == ["start_s", "end_s"]
        for run in two_move_demonstrations:
            np.testing.assert_allclose(cuts[name].loc[run.name], run.true_segments[place], atol=0.15)


def test_one_run_without_them_and_all_are_cut_alike(two_move_demonstrations):
    mixed = [*two_move_demonstrations[:-1], *unknown(two_move_demonstrations[-1:])]
    cuts = execution_cuts(mixed, NAMES, CUTTING)
    alike = execution_cuts(unknown(two_move_demonstrations), NAMES, CUTTING)
    for name in NAMES:
        np.testing.assert_array_equal(cuts[name], alike[name])


def test_segments_of_another_task_are_not_taken(two_move_demonstrations):
    """Two commanded primitives cannot be the three that are asked for."""
    fewer = [replace(run, true_segments=run.true_segments[:2]) for run in two_move_demonstrations]
    cuts = execution_cuts(fewer, NAMES, CUTTING)
    assert cuts["forward"].loc["01", "end_s"] == pytest.approx(
        two_move_demonstrations[0].true_segments[2, 1], abs=0.15
    )


@pytest.mark.parametrize("skip_failures", [False, True])
def test_a_run_that_cannot_be_cut_is_named(two_move_demonstrations, skip_failures):
    """Also where demonstrations may be left out: everything that is learned needs every run."""
    first, second, *others = unknown(two_move_demonstrations)
    runs = [first, replace(second, position=np.zeros_like(second.position)), *others]
    parameters = CUTTING.model_copy(update={"skip_failures": skip_failures})
    with pytest.raises(InputError, match="02: primitive 'down'"):
        execution_cuts(runs, NAMES, parameters)


def test_the_reference_of_the_demonstrations_need_not_be_among_the_runs(two_move_demonstrations):
    runs = unknown(two_move_demonstrations)
    elsewhere = CUTTING.model_copy(update={"reference": "taught_by_hand_3"})
    expected = execution_cuts(runs, NAMES, CUTTING)
    for name, table in execution_cuts(runs, NAMES, elsewhere).items():
        np.testing.assert_array_equal(table, expected[name])
