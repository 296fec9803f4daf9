"""The same bits on every x86-64 processor with AVX2: variables that pin libraries, and a check of libraries.

numpy, OpenBLAS, PyTorch (with MKL and oneDNN) and numba choose kernels by processor and number of threads,
and kernels round differently. Stages, commands and the package `dissertation` pin all to AVX2 and one thread,
whatever the caller has set. Libraries read the variables when they are loaded, so `pin` comes first. Whoever
imports the library alone, as a robot's controller does, is not pinned.

`STRUCTLEARN_BITS=native` leaves the choice to the libraries. For other programs, e.g. workers of Dask:

    eval "$(python -m structlearn.core.processor)"

Loads nothing but the standard library. Which operations agree: `benchmarks/processor_bits.py`.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache

from structlearn.core.errors import InputError

PINS = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR",  # all that numpy has beyond AVX2
    "OPENBLAS_CORETYPE": "Haswell",  # of numpy's OpenBLAS and of scipy's
    "ATEN_CPU_CAPABILITY": "avx2",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
    "MKL_CBWR": "COMPATIBLE",  # of torch's MKL, which does not honour AVX2 on processors of AMD
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": "+avx2,+fma,+bmi,+bmi2,+f16c,+lzcnt,+movbe,+popcnt",
    # sums depend on the number of threads; torch takes MKL's number if there is one
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
BITS, NATIVE = "STRUCTLEARN_BITS", "native"
FLAGS = frozenset(("avx2", "fma", "bmi1", "bmi2", "f16c", "abm", "movbe", "popcnt"))  # of x86-64-v3, to Linux
STARTED_AGAIN = "STRUCTLEARN_STARTED_AGAIN"  # number of the process that was

_late: list[str] = []  # libraries that were loaded before they were pinned


def pin() -> None:
    """Set the variables, unless the user has opted out or the processor does not have these instructions."""
    if os.environ.get(BITS) != NATIVE and _has_avx2():
        if not pinned():
            _late[:] = [name for name in ("numpy", "torch", "numba") if name in sys.modules]
        os.environ.pop("NPY_ENABLE_CPU_FEATURES", None)  # numpy does not load with both
        os.environ.update(PINS)


def pinned() -> bool:
    """Whether the variables are set in this process."""
    return PINS.items() <= os.environ.items()


def deviations() -> str:
    """Why results may have other bits, by what loaded libraries say of themselves; empty if they have not.

    Empty too if the user has opted out. Raises InputError: the variable for that has another value.
    """
    given = os.environ.get(BITS, "")
    if given not in ("", NATIVE):
        raise InputError(f"{BITS}={given}: is not {NATIVE}")
    if given == NATIVE:
        return ""
    if not _has_avx2():
        return "this is not an x86-64 processor with AVX2"
    late = [f"{name} was loaded before it was pinned" for name in _late]
    return "; ".join([*late, *_of_kernels(), *_of_threads()])


def require_pins() -> None:
    """Pin this process; start it again, once, if a library was loaded before. Warn if it cannot be pinned."""
    pin()
    found = deviations()
    if found and pinned() and os.environ.get(STARTED_AGAIN) != str(os.getpid()):
        if sys.argv[0] in ("", "-"):  # standard input cannot be read again
            raise InputError(f"{found}; set the variables that `python -m {__name__}` prints")
        os.environ[STARTED_AGAIN] = str(os.getpid())
        sys.stdout.flush()
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    if found:
        print(f"warning: {found}: last digits will differ from those of others", file=sys.stderr)


@cache
def _has_avx2() -> bool:
    """Whether Linux says that the processor has all instructions of x86-64-v3."""
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
        return set(next((line for line in lines if line.startswith("flags")), "").split()) >= FLAGS
    return False


def _of_kernels() -> Iterator[str]:
    """Instructions that numpy, torch and numba use, where they are others than those of the pins."""
    for name in ("numpy._core._multiarray_umath", "numpy.core._multiarray_umath"):  # since 2.0; before
        if numpy := sys.modules.get(name):
            has = [one for one in numpy.__cpu_dispatch__ if numpy.__cpu_features__[one]]
            yield from [f"numpy uses {one}" for one in has if one.startswith(("AVX512", "X86_V4"))][:1]
    if torch := sys.modules.get("torch"):
        capability = torch.backends.cpu.get_cpu_capability()
        yield from [f"torch uses {capability}"] if capability != "AVX2" else []
    if config := sys.modules.get("numba.core.config"):
        own = PINS["NUMBA_CPU_NAME"] != config.CPU_NAME
        yield from [f"numba compiles for {config.CPU_NAME or 'this processor'}"] if own else []


def _of_threads() -> Iterator[str]:
    """Kernels and threads of OpenBLAS and OpenMP, where they are others than those of the pins."""
    if "numpy" in sys.modules:
        from threadpoolctl import threadpool_info  # of the extra `learn`, as stages are

        for library in threadpool_info():
            name, kernels = library["internal_api"], library.get("architecture")
            if kernels not in (None, PINS["OPENBLAS_CORETYPE"]):
                yield f"{name} uses kernels for {kernels}"
            if library["num_threads"] != 1:
                yield f"{name} uses {library['num_threads']} threads"


def main() -> None:
    """Print the variables for a shell."""
    for name, value in PINS.items():
        print(f"export {name}={value}")


if __name__ == "__main__":
    main()
