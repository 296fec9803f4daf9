"""Compiled functions as values: which kernel compiled code calls is stored as a number in its tables.

Numba compiles a caller anew for every function it is given. A controller learns only from a skill's file
which networks it runs, so each network has a kernel, all with one signature, and tables hold their addresses:

    address = PhaseModulatedNetwork.kernel.address                # of the function decorated with `kernel`
    c = call(address, sizes, values, row, deviations, memory)     # in any compiled function

An address is valid in its process only.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from structlearn.core.compilation import numba

_NUMBERS = types.float64[::1]

kernel = numba.cfunc(types.float64(types.int64[::1], *4 * [_NUMBERS]), cache=True)
"""Compile the forward pass of a network at one sample: (sizes, values, row, deviations, memory) -> c.

All arguments are contiguous arrays. `sizes`, `values` and `memory` may be longer than the network needs, as
tables are padded. The memory is 0 when a movement begins, and persists from sample to sample.
"""


@intrinsic
def _call(
    context: Any, address: Any, sizes: Any, values: Any, row: Any, deviations: Any, memory: Any
) -> tuple[Any, Any]:
    arrays = (sizes, values, row, deviations, memory)
    if not all(isinstance(kind, types.Array) and kind.ndim == 1 and kind.layout == "C" for kind in arrays):
        raise TypingError(f"a kernel takes contiguous arrays, not {arrays}")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in signature.args[1:]]
        function = ir.FunctionType(ir.DoubleType(), kinds).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), arguments[1:])

    return types.float64(types.int64, *arrays), generate


@numba.njit(cache=True, forceinline=True)
def call(
    address: int,
    sizes: np.ndarray,
    values: np.ndarray,
    row: np.ndarray,
    deviations: np.ndarray,
    memory: np.ndarray,
) -> float:
    """Call a kernel from compiled code; see `kernel`."""
    return _call(address, sizes, values, row, deviations, memory)  # type: ignore[call-arg]  # numba adds one
