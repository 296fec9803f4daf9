from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from reporting_scraping import PARAMETERS

from structlearn.core.errors import InputError
from structlearn.primitives import fitting
from structlearn.segmentation.segments import cut

FIT = committed(fitting.FitParameters, "fit_primitives", smoothing_hz=8.0)


@pytest.fixture(scope="module")
def segmentation(two_move_demonstrations):
    return cut(two_move_demonstrations, PARAMETERS)


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
