"""The example task's skill, learned from its true cuts, for tests of what is done with it."""

from functools import lru_cache

import numpy as np
import pandas as pd

from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.fitting import FitParameters, learn_sequence
from structlearn.recordings import synchronise
from structlearn.testbeds.own.world.pick_and_place import takes

FIT = FitParameters(smoothing_hz=5.0, kernel_count=25, regression="joint", scaled_axes=(True, False, False))


@lru_cache
def pick_primitives():
    """Reach, carry and retreat of three demonstrations."""
    made = takes(seed=1, moves=3, count=3)
    demonstrations = [synchronise(take.recording, 200.0, 0.2) for take in made]
    return made, demonstrations
