"""How far the two engines of the testbed agree: some executions, repeated in PyBullet."""

from collections.abc import Callable, Sequence

import numpy as np

from structlearn.ground.artefacts import Metrics
from structlearn.recordings.recording import Recording
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

COMPARED = {
    "pose": ("position_m", slice(0, 3)),
    "joint_torques": ("torque_n_m", slice(None)),
    "tactile": ("counts", slice(None)),
}
"""By kind of stream, the difference that is taken of it, and the columns."""

LARGEST = {"position_m": 1e-6, "torque_n_m": 1e-3, "counts": 1.0}
"""What is allowed. They agree to 1e-13 m and 1e-11 N m; a contact may magnify how another processor rounds,
and a count then falls to the other side."""


def engine_differences(
    execute: Callable[[TestbedParameters], Sequence[Recording]], testbed: TestbedParameters
) -> Metrics:
    """Largest differences between executions by the compiled engine and the same ones in PyBullet.

    Args:
        execute: a stage's executions, or some of them, in a testbed.
        testbed: of the stage.

    Returns:
        `position_m` of the hand, `torque_n_m` of the arm's joints, `counts` of the fingers; nothing where the
        stage runs in PyBullet anyway.

    Raises:
        RuntimeError: a difference is larger than `LARGEST` allows.
    """
    if testbed.engine == "pybullet":
        return {}
    found = dict.fromkeys(LARGEST, 0.0)
    other = testbed.model_copy(update={"engine": "pybullet"})
    for one, two in zip(execute(testbed), execute(other), strict=True):
        for first, second in zip(one.streams, two.streams, strict=True):
            if first.kind in COMPARED:
                name, columns = COMPARED[first.kind]
                off = np.abs(first.values[:, columns] - second.values[:, columns])
                found[name] = max(found[name], float(off.max()))
    for name, value in found.items():
        if value > LARGEST[name]:
            raise RuntimeError(f"the engines differ: {name} by {value:g}, {LARGEST[name]:g} is allowed")
    return found
