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

from typing import Any

import numpy as np
from numba.core import cgutils
from numba.np.arrayobj import get_itemsize, make_array, populate_array
from numba.np.numpy_support import from_dtype

from structlearn.core.compilation import intrinsic, numba, types

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
            words = make_array(signature.args[0])(context, builder, arguments[0]).data
            return _read(context, builder, kind, _Words(builder, words))

        return kind(table), generate

    return unpacked


def _words(value: Packable, example: Packable) -> Any:
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
        yield np.array(value, dtype=type(example)).view(np.int64)


def _kind(example: Packable) -> Any:
    """Numba's type of a packable value."""
    if isinstance(example, np.ndarray):
        return types.Array(from_dtype(example.dtype), example.ndim, "C")
    if isinstance(example, tuple):
        kinds = [_kind(part) for part in example]
        named = hasattr(example, "_fields")
        return types.NamedTuple(kinds, type(example)) if named else types.Tuple(kinds)
    return numba.typeof(example)


class _Words:
    """The words of a table, one after the other, in code that is being generated."""

    def __init__(self, builder: Any, pointer: Any) -> None:
        self._builder, self._pointer, self._place = builder, pointer, 0

    def following(self) -> Any:
        """The next word."""
        word = self._builder.load(cgutils.gep_inbounds(self._builder, self._pointer, self._place))
        self._place += 1
        return word


def _read(context: Any, builder: Any, kind: Any, words: _Words) -> Any:
    """Code that makes a value of a type from the next words."""
    if isinstance(kind, types.BaseTuple):
        return context.make_tuple(builder, kind, [_read(context, builder, one, words) for one in kind])
    if not isinstance(kind, types.Array):
        word = words.following()
        return builder.bitcast(word, context.get_value_type(kind)) if kind is types.float64 else word
    address, shape = words.following(), [words.following() for _ in range(kind.ndim)]
    array, itemsize = make_array(kind)(context, builder), cgutils.intp_t(get_itemsize(context, kind))
    strides = [itemsize]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    data = builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer())
    populate_array(
        array, data=data, shape=shape, strides=strides[: kind.ndim], itemsize=itemsize, meminfo=None
    )
    return array._getvalue()
