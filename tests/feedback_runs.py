"""Made-up executions on one clock: 3 primitives, 6 tactile channels, a tool that lies as it is told."""

import numpy as np
import pandas as pd

from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration

RATE_HZ = 100.0
SEGMENTS = np.array([[0.0, 0.5], [0.5, 2.5], [2.5, 5.0]])
NAMES = ("down", "turn", "scrape")
Y = np.array([0.0, 1.0, 0.0])


def execution(name="01", roll=0.0, seed=0, axis=Y, segments=SEGMENTS, **changes):
    """Demonstration whose tool has a roll (scalar or (T,)) in rad relative to the board."""
    time = np.arange(round(SEGMENTS[-1, 1] * RATE_HZ) + 11) / RATE_HZ
    rng = np.random.default_rng(seed)
    turns = quaternion.from_rotation_vector(np.broadcast_to(roll, len(time))[:, None] * axis)
    signals = {
        "position": np.zeros((len(time), 3)),
        "orientation": turns,
        "tool_to_board": turns,
        "tactile": np.rint(rng.normal(0.0, 10.0, (len(time), 6))),
        "wrench": np.tile([0.0, 0.0, -1.0, 0.0, -2e-3, 0.0], (len(time), 1)),
        "true_segments": segments,
    }
    return Demonstration(name=name, time=time, **(signals | changes))


def cuts(runs, names=NAMES):
    """Their commanded segments by primitive."""
    labels = pd.Index([run.name for run in runs], name="demonstration")
    return {
        name: pd.DataFrame([SEGMENTS[place]] * len(runs), columns=["start_s", "end_s"], index=labels)
        for place, name in enumerate(NAMES)
        if name in names
    }
