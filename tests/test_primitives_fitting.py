"""Leaving demonstrations out: the same primitives as fitted to the others alone."""

import numpy as np
import pytest
from committed import committed
from primitives_movements import reach, wobbly_turn

from structlearn.primitives import kernels
from structlearn.primitives.fitting import FitParameters, learn_primitive, learn_subsets
from structlearn.primitives.twist_swing import TwistSwingPrimitive

DURATIONS = (1.0, 1.3, 1.3, 0.8, 1.7)
FIT = committed(FitParameters, "fit_primitives", kernel_count=15)


def segments(turn=0.6, steep=0):
    """Demonstrations of different lengths; the last `steep` ones go up, far enough to decide the frame."""
    rng, made = np.random.default_rng(3), []
    for place, duration in enumerate(DURATIONS):
        up = place >= len(DURATIONS) - steep
        goal = rng.normal([0.0, 0.0, 3.0] if up else [0.3, 0.1, 0.05], 0.03)
        turned = wobbly_turn(rng, turn * (1.0 + 0.1 * place), 0.2, duration)
        made.append((reach(rng, np.zeros(3), goal, duration, dt=turned.dt), turned))
    return made


def learned(primitive):
    """All that is learned, by what it is."""
    local, turn = primitive.position.local, primitive.orientation
    turn = turn.chart if isinstance(turn, TwistSwingPrimitive) else turn
    return {
        (of, name): np.asarray(value)
        for of, one in enumerate((local, turn))
        for name, value in vars(one).items()
        if value is not None
    } | {(2, "ends"): np.concatenate([primitive.position.start, primitive.position.goal])}


@pytest.mark.parametrize("method", ["joint", "local"])
@pytest.mark.parametrize("scaled", [(True, False, False), (False, False, False)])
@pytest.mark.parametrize("left_out", [[0], [4], [1, 2], [0, 1, 2, 3]])
@pytest.mark.parametrize(
    "data", [segments(), segments(steep=1), segments(turn=4.0)], ids=["", "steep", "turns"]
)
def test_leaving_out_is_fitting_the_others(data, left_out, scaled, method):
    parameters = FIT.model_copy(update={"scaled_axes": scaled, "regression": method})
    used = ~np.isin(np.arange(len(data)), left_out)
    found = learn_subsets("reach", data, parameters)(used, method)
    expected = learn_primitive("reach", [data[place] for place in np.flatnonzero(used)], parameters)
    assert found.position.frame == expected.position.frame
    assert type(found.orientation) is type(expected.orientation)
    values = learned(found)
    for name, value in learned(expected).items():
        np.testing.assert_allclose(
            values[name], value, rtol=0, atol=2e-12 * np.abs(value).max(), err_msg=name
        )


def test_the_frame_follows_those_that_are_used():
    fit, all_used = learn_subsets("reach", segments(steep=1), FIT), np.ones(len(DURATIONS), dtype=bool)
    assert fit(all_used, "joint").position.frame == "side"
    assert fit(all_used & (np.arange(len(DURATIONS)) < 4), "joint").position.frame == "up"


def test_samples_are_read_once_whatever_is_left_out(monkeypatch):
    fit, used = learn_subsets("reach", segments(), FIT), np.ones(len(DURATIONS), dtype=bool)
    fit(used, "joint")
    monkeypatch.setattr(kernels, "features", None)
    kernels.shared_features.clear()
    for place in range(len(DURATIONS)):
        fit(np.arange(len(DURATIONS)) != place, "joint")


def test_shared_features_keep_to_their_memory(monkeypatch):
    kernels.shared_features.clear()
    first = kernels.unit_features(100)
    assert kernels.unit_features(100) is first
    monkeypatch.setattr(kernels, "SHARED_BYTES", 3 * first.nbytes)
    second = kernels.unit_features(101)
    kernels.unit_features(100)  # used again, so the other one is the oldest
    kernels.unit_features(99)
    kernels.unit_features(98)
    assert sum(values.nbytes for values in kernels.shared_features.values()) <= 3 * first.nbytes
    assert kernels.unit_features(100) is first
    assert kernels.unit_features(101) is not second
