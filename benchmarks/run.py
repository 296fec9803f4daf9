"""Time structlearn's inner loops beside the public libraries that do the same work.

    python benchmarks/run.py [--only WORD] [--seconds S] [--output table.csv]

Everything runs on one thread. The peers come with the extra `bench`; those that are absent are named so.
"""

import argparse
import os
import platform
from importlib import metadata
from pathlib import Path

# One thread: these are read when numpy, numba and torch are imported, so they come first.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import controller
import dynamics
import feedback_training
import policy_search
import primitives
import reading
import regression
import skin_distances
import state_dynamics
import warping
from timing import SECONDS_PER_CASE, machine, measure, table, write_csv

MODULES = (
    controller,
    primitives,
    feedback_training,
    policy_search,
    warping,
    regression,
    skin_distances,
    state_dynamics,
    dynamics,
    reading,
)

PACKAGES = (
    "structlearn",
    "numpy",
    "scipy",
    "numba",
    "movement-primitives",
    "mp-pytorch",
    "pydmps",
    "torch",
    "dtaidistance",
    "tslearn",
    "cma",
    "cmaes",
    "scikit-learn",
    "pin",
    "mujoco",
    "rosbags",
    "mcap-ros2-support",
)


def main() -> None:
    """Measure all cases, print the table and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="measure only work whose name contains this")
    parser.add_argument("--seconds", type=float, default=SECONDS_PER_CASE, help="time to spend on each case")
    parser.add_argument("--output", type=Path, help="write the rows to this CSV file too")
    options = parser.parse_args()
    rows, notes = [], []
    for build in [build for module in MODULES for build in module.CASES]:
        case = build()
        if options.only in case.work:
            rows += measure(case, options.seconds)
            notes += [f"{case.work}: {case.note}"] if case.note else []
    if not rows:
        parser.error(f"no work is called {options.only!r}")
    print(machine())
    print(f"Python {platform.python_version()}, " + ", ".join(map(_version, PACKAGES)))
    print("One thread, medians of interleaved runs in ms; `again`: repeated at once; ratio: peer / ours;")
    print("`off by`: largest deviation from the reference, relative to its range.")
    print(table(rows), *notes, sep="\n")
    if options.output:
        write_csv(rows, options.output)


def _version(package: str) -> str:
    try:
        return f"{package} {metadata.version(package)}"
    except metadata.PackageNotFoundError:
        return f"{package} not installed"


if __name__ == "__main__":
    main()
