"""Point of contact from electrodes."""

import numpy as np
import pytest

from structlearn.ground.errors import InputError
from structlearn.tactile.electrodes import biotac
from structlearn.tactile.touch_preparation import contact_points


def published(signal: np.ndarray) -> np.ndarray:
    """One sample in mm, by the published formula for the BioTac with its two cases."""
    weight = np.minimum(signal, 0) ** 2
    c = (weight[:, None] * 1e3 * biotac().electrodes).sum(axis=0) / weight.sum()
    if c[0] > 0:
        return 7 * c / np.linalg.norm(c)
    return np.array([c[0], *(7 * c[1:] / np.linalg.norm(c[1:]))])


def test_agrees_with_the_published_formula():
    signals = np.random.default_rng(0).normal(size=(200, 19)) * 50
    found = 1e3 * contact_points(signals, biotac())
    assert found[:, 0].min() < 0 < found[:, 0].max()
    np.testing.assert_allclose(found, [published(signal) for signal in signals], atol=1e-9)


def test_a_rise_does_not_pull():
    signals = np.zeros((2, 19))
    signals[:, 3] = -10
    signals[1, 8] = 500  # bulge
    found = contact_points(signals, biotac())
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda signals: signals[:, :5], "has 19 electrodes"),
        (lambda signals: np.where(np.arange(19) == 4, np.nan, signals), "row 0, electrode 5: value is nan"),
        (lambda signals: signals * [[1], [-1]], "row 1: nothing touches"),
    ],
)
def test_what_cannot_be_estimated_is_named(change, message):
    with pytest.raises(InputError, match=message):
        contact_points(change(-np.ones((2, 19))), biotac())
