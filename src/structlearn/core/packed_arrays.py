"""Many arrays as one argument of a compiled function.

A call from Python takes 0.1 us for each array that numba has to look at, which for a function that is called
at every tick of a robot is more than its work. So it is given a table with the arrays' addresses and shapes,
built once, and reads the arrays from there:

    EMPTY = Plan(...)                        # any value: it has the types that all have
    plan_of = unpacking(EMPTY)

    @numba.njit
    def tick(table): plan = plan_of(table)   # a `Plan` of the very arrays, nothing is copied

    table = packed(plan, EMPTY)              # checks the types
    tick(table)

A table is valid in its process, and as long as its arrays exist: whoever keeps it keeps them too.
"""

from collections.abc import Iterator
from itertools import count
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import get_itemsize, make_array, populate_array
from numba.np.numpy_support import from_dtype

from structlearn.core.compilation import numba

Packable = Any
"""An array, an integer, a float, or a (named) tuple of packable values."""


def packed(value: Packable, example: Packable) -> np.ndarray:
    """Table (W,) of int64 for a value; the arrays must outlive it.

    `example`: the one that `unpacking` was given.

    Raises TypeError: the types differ from the example's, or an array is not contiguous and writable.
    """
    return np.array(list(_words(value, example)), dtype=np.int64)


def unpacking(example: Packable) -> Any:
    """Compiled function of a table that returns the value with its arrays; types are those of `example`."""
    kind = _kind(example)

    @intrinsic
    def unpacked(context: Any, table: Any) -> tuple[Any, Any]:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            first = make_array(signature.args[0])(context, builder, arguments[0]).data
            words = (builder.load(cgutils.gep_inbounds(builder, first, place)) for place in count())
            return _read(context, builder, example, words)

        return kind(table), generate

    return unpacked


def _words(value: Packable, example: Packable) -> Iterator[int]:
    """Words of a value: per array its address and shape."""
    if type(value) is not type(example):
        raise TypeError(f"a table of {type(example).__name__} was given {type(value).__name__}")
    if isinstance(value, tuple):
        for part, part_example in zip(value, example, strict=True):
            yield from _words(part, part_example)
    elif isinstance(value, np.ndarray):
        if (value.dtype, value.ndim) != (example.dtype, example.ndim) or not value.flags.carray:
            raise TypeError(
                f"a table holds contiguous, writable {example.dtype} arrays of {example.ndim} dimensions "
                f"here, not {value.dtype} of {value.ndim}"
            )
        yield value.ctypes.data
        yield from value.shape
    else:
        yield int(np.array(value, dtype=type(example)).view(np.int64))


def _kind(example: Packable) -> Any:
    """Numba's type of a packable value."""
    if isinstance(example, np.ndarray):
        return types.Array(from_dtype(example.dtype), example.ndim, "C")
    if isinstance(example, tuple):
        named = type(example) if hasattr(example, "_fields") else None
        return types.BaseTuple.from_types([_kind(part) for part in example], named)
    return numba.typeof(example)


def _read(context: Any, builder: Any, example: Packable, words: Iterator[Any]) -> Any:
    """Code that makes a value of the example's type from the next words, in the order of `_words`."""
    kind = _kind(example)
    if isinstance(example, tuple):
        parts = [_read(context, builder, part, words) for part in example]
        return context.make_tuple(builder, kind, parts)
    if not isinstance(example, np.ndarray):
        word = next(words)
        return builder.bitcast(word, context.get_value_type(kind)) if kind is types.float64 else word
    address, shape = next(words), [next(words) for _ in range(kind.ndim)]
    array, itemsize = make_array(kind)(context, builder), cgutils.intp_t(get_itemsize(context, kind))
    strides = [itemsize]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    data = builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer())
    populate_array(
        array, data=data, shape=shape, strides=strides[: kind.ndim], itemsize=itemsize, meminfo=None
    )
    return array._getvalue()
