"""Numbers on obstacle avoidance as the dissertation prints them (tables IV.1 to IV.3, figure IV.10).

Goal distances are in m; obstacle distances are unitless, (|x - centre| - r) / r, a hit where not positive.
"""

from collections.abc import Mapping

from structlearn.avoidance.learned_models import HUMAN_INSPIRED, NETWORK
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import NO_MODEL

DEMONSTRATIONS = "demonstrations"

Numbers = Mapping[str, float]
"""Columns of `obstacles.evaluation.summary`."""


def _numbers(goal_max: float, goal_mean: float, low: float, mean: float, hits: int) -> dict[str, float]:
    distances = {"obstacle_min": low, "obstacle_mean": mean}
    return {"goal_max": goal_max, "goal_mean": goal_mean} | distances | {"hits": hits}


PER_SETTING: Mapping[str, Numbers] = {
    NO_MODEL: _numbers(0.017, 0.017, -0.451, 4.992, 4),
    HUMAN_INSPIRED: _numbers(1.218, 0.072, -0.520, 5.038, 2),
    NETWORK: _numbers(0.113, 0.016, 0.083, 5.241, 0),
    DEMONSTRATIONS: _numbers(0.075, 0.028, 1.409, 5.461, 0),
}
"""Table IV.1 by model, 120 scenarios."""

PER_SHAPE: Mapping[str, Mapping[str, Numbers]] = {
    "sphere": {
        NO_MODEL: _numbers(0.017, 0.017, -0.025, 4.739, 1),
        NETWORK: _numbers(0.152, 0.018, 0.433, 5.063, 0) | {"nmse_train": 0.155, "nmse_test": 0.152},
    },
    "cube": {
        NO_MODEL: _numbers(0.017, 0.017, -0.451, 5.722, 1),
        NETWORK: _numbers(0.145, 0.015, 1.045, 5.964, 0) | {"nmse_train": 0.164, "nmse_test": 0.159},
    },
    "cylinder": {
        NO_MODEL: _numbers(0.017, 0.017, -0.280, 4.514, 2),
        NETWORK: _numbers(0.078, 0.014, 0.750, 5.117, 0) | {"nmse_train": 0.195, "nmse_test": 0.195},
    },
}
"""Table IV.2 by shape and model, 40 scenarios each."""

UNSEEN: Mapping[str, Numbers] = {
    "": _numbers(0.017, 0.017, -0.918, 0.095, 35),
    "sphere": _numbers(0.011, 0.034, -0.918, 0.933, 2),
    "cube": _numbers(0.021, 0.119, 1.172, 2.235, 0),
    "cylinder": _numbers(0.033, 0.120, -0.103, 1.704, 1),
}
"""Table IV.3 by what the network learned from, 63 spheres; as printed, though the largest goal distances are
below the mean ones, and the smallest obstacle distance of `sphere` is that of no network."""

LARGEST_NMSE = 0.1
"""Figure IV.10: of the network in every one of the 120 scenarios, learned from and held out."""

DOMINANT_SCENARIOS = 43
"""Of 120: those that have a dominant axis of avoidance."""

UNSEEN_HITS = 2
"""Most hits of a network on the 63 unseen spheres."""
