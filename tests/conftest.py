"""Settings and small data that several test files share."""

import fcntl
import os
from pathlib import Path

import caller_environment  # noqa: F401 - before all that PYTHONPATH could hide
import numpy as np
import pytest
import readers_bags
from hypothesis import settings
from reduced_pipeline import by_hand, clone

from structlearn.core import quaternion, signals
from structlearn.core.parallel import BACKEND
from structlearn.feedback import models
from structlearn.readers.demonstration import Demonstration

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("repeatable")

os.environ.setdefault(BACKEND, "sequential")  # tests of processes ask for them; starting them takes long

ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """First the pipeline; what waits for it, recorded data first, where another process gets when it is done.

    So the last that are given out are short, and all processes end together.
    """
    waiting = {item.path for item in items if "reduced_project" in item.fixturenames}
    pipeline, recorded = ROOT / "tests/test_pipeline.py", ROOT / "tests/test_pipeline_recorded.py"
    others = list(dict.fromkeys(item.path for item in items if item.path not in waiting))
    third = len(others) // 3
    order = [pipeline, *others[:third], recorded, *sorted(waiting - {pipeline, recorded}), *others[third:]]
    rank = {path: place for place, path in enumerate(order)}
    items.sort(key=lambda item: rank[item.path])


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root."""
    return ROOT


@pytest.fixture(scope="session")
def reduced_project(root, tmp_path_factory) -> Path:
    """Whole pipeline on reduced parameters, run once for all tests, which only read it."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    project, finished = folder / "reduced_project", folder / "reduced_project.finished"
    with open(folder / "reduced_project.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not finished.exists():
            by_hand(clone(root, project))
            finished.touch()
    return project


@pytest.fixture(scope="session")
def example_networks(root) -> str:
    """Feedback networks of `examples/` are found by their modules' names, as with STRUCTLEARN_NETWORKS."""
    models.__path__.append(str(root / "examples"))
    return str(root / "examples")


@pytest.fixture(scope="session")
def recorded_data() -> Path:
    """Folder of the public recordings; tests that need it are skipped where it is not."""
    return readers_bags.recorded_data("clmc").parent


def minimum_jerk(fraction: np.ndarray) -> np.ndarray:
    """From 0 to 1 with speed and acceleration zero at both ends."""
    return signals.minimum_jerk(np.clip(fraction, 0.0, 1.0))


def two_move_demonstration(name: str, stretch: float = 1.0, rest: float = 0.5) -> Demonstration:
    """Down 8 cm along z, rest, forward 6 cm along y with a turn; 100 Hz; known cut points."""
    down, pause, forward = 1.5 * stretch, 0.6, 2.0 * stretch
    starts = np.cumsum([rest, down, pause, forward])
    time = np.arange(round((starts[-1] + rest) * 100)) / 100
    z = -0.08 * minimum_jerk((time - starts[0]) / down)
    y = 0.06 * minimum_jerk((time - starts[2]) / forward)
    roll = 0.3 * minimum_jerk((time - starts[1]) / pause)
    zero = np.zeros_like(time)
    return Demonstration(
        name=name,
        time=time,
        position=np.column_stack([zero, y, 0.5 + z]),
        orientation=quaternion.from_rotation_vector(np.column_stack([roll, zero, zero])),
        true_segments=np.array([starts[:2], starts[1:3], starts[2:]]),
        provenance={"origin": "simulated"},
    )


@pytest.fixture(scope="session")
def two_move_demonstrations() -> list[Demonstration]:
    """Five demonstrations at different speeds and with different rests."""
    stretches, rests = [1.0, 1.2, 0.85, 1.1, 0.95], [0.5, 0.7, 0.4, 0.9, 0.6]
    return [
        two_move_demonstration(f"{place + 1:02d}", stretch, rest)
        for place, (stretch, rest) in enumerate(zip(stretches, rests, strict=True))
    ]
