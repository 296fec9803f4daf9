"""Tables of arrays: compiled code gets the very arrays, and other types are refused."""

from typing import NamedTuple

import numpy as np
import pytest

from structlearn.core.compilation import numba
from structlearn.core.packed_arrays import packed, unpacking


class Inner(NamedTuple):
    flags: np.ndarray
    cube: np.ndarray
    scale: float


class Outer(NamedTuple):
    count: int
    counts: np.ndarray
    inner: Inner
    single: np.ndarray


EXAMPLE = Outer(
    0, np.zeros(0, np.int64), Inner(np.zeros(0, bool), np.zeros((0, 0, 0)), 0.0), np.zeros(0, "f4")
)
outer_of = unpacking(EXAMPLE)


@numba.njit
def read_and_write(table):
    outer = outer_of(table)
    inner = outer.inner
    total = outer.count + inner.scale * inner.cube[1, 0, 3] + inner.cube.shape[2] + outer.single[-1]
    outer.counts[1:] += 10
    inner.cube[0] = 7.0
    return total, inner.flags.sum()


def values():
    cube = np.arange(24.0).reshape(2, 3, 4)
    return Outer(-3, np.arange(3), Inner(np.array([True, False, True]), cube, 0.5), np.array([1, 2], "f4"))


def test_compiled_code_reads_and_writes_the_very_arrays():
    outer = values()
    assert read_and_write(packed(outer, EXAMPLE)) == (-3 + 0.5 * 15.0 + 4 + 2, 2)
    assert outer.counts.tolist() == [0, 11, 12]
    assert (outer.inner.cube[0] == 7.0).all()
    assert outer.inner.cube[1].ravel().tolist() == list(range(12, 24))


@pytest.mark.parametrize(
    "counts",
    [
        np.arange(3.0),
        np.arange(3, dtype=np.int32),
        np.zeros((3, 1), np.int64),
        np.arange(6)[::2],
        np.broadcast_to(np.int64(1), (1,)),
    ],
    ids=["another type", "fewer bits", "more dimensions", "not contiguous", "read only"],
)
def test_arrays_of_another_kind_are_refused(counts):
    with pytest.raises(TypeError, match=r"a table holds contiguous, writable int64 arrays of 1 dimensions"):
        packed(values()._replace(counts=counts), EXAMPLE)


def test_values_of_another_kind_are_refused():
    with pytest.raises(TypeError, match="a table of Inner was given Outer"):
        packed(values()._replace(inner=EXAMPLE), EXAMPLE)
    with pytest.raises(TypeError, match="a table of int was given float"):
        packed(values()._replace(count=1.5), EXAMPLE)
