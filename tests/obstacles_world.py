"""A small obstacle testbed that has been evaluated: what the tests of its page and recordings look at."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd
from committed import committed
from obstacles_unrolls import baseline

from dissertation.obstacles.protocol import avoidance_protocols
from dissertation.obstacles.protocol.avoidance_scores import demonstration_scores
from dissertation.obstacles.world.scenarios import Scenario, own_scenarios
from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.core.params import Population
from structlearn.readers.demonstration import Demonstration

NEAR, FAR, BESIDE = [0.4, -0.15, 0.25], [0.4, -0.45, 0.6], [0.5, 0.15, 0.3]
PRIMITIVE = baseline()
POPULATION = Population(tuning=[1], test=[11, 12])
PEOPLE = [1, 11, 12]
PLACES = [
    Scenario(number, obstacle(shape, np.array(centre), yaw=0.5))
    for shape in SHAPES
    for number, centre in enumerate((NEAR, FAR, BESIDE), start=1)
]
TESTED = committed(
    avoidance_protocols.AvoidanceEvaluationParameters,
    "obstacle_evaluation",
    rate_hz=25.0,
    kept_every=1,
    speeds_m_s=(0.1,),
    pairs=6,
)


@dataclass(frozen=True)
class Push:
    """A model that pushes upwards wherever the obstacle is."""

    size: float

    def __call__(self, features, phase, phase_velocity):
        return np.tile([0.0, 0.0, self.size], (len(features), 1))

    def take(self, scenarios):
        return self


def demonstrations():
    """Reaches 10 cm above the baseline and more."""
    path = PRIMITIVE.unroll(0.04)
    lifts = [np.array([0, 0, 0.1 + 0.01 * number]) for number in range(3)]
    origin = {"origin": "simulated"}
    return [
        Demonstration(f"{number}", path.time, path.position + lift, provenance=origin)
        for number, lift in enumerate(lifts)
    ]


@cache
def evaluation():
    """Scores and paths of all situations with models of every kind, and scores of the demonstrations.

    The reaches are those of the person shown; the distances of the two others differ a little.
    """
    shapes = {shape: Push(4.0) for shape in SHAPES}
    models = {
        "network": {"setting": Push(5.0), "all": Push(3.0)} | shapes,
        "ensemble": {"all": Push(3.5)} | shapes,
        "human_inspired": {"setting": Push(9.0)} | shapes,
        "phase_modulated": {"all": Push(2.0)},
    }
    shown, *others = PEOPLE
    learner = avoidance_protocols.Learner(shown, PRIMITIVE, models, own_scenarios(PLACES, PEOPLE)[shown])
    found = [
        avoidance_protocols.evaluate_avoidance((learner, one), TESTED, shown)
        for one in avoidance_protocols.situations(PLACES, PRIMITIVE, TESTED)
    ]
    scores, paths = (pd.concat(parts, ignore_index=True) for parts in zip(*found, strict=True))
    judged = scores[scores["model"] != "phase_modulated"]
    far = judged.filter(regex="_m$").columns
    people = [judged.assign(person=one, **(1.0 + 1e-3 * one) * judged[far]) for one in others]
    scored = demonstration_scores([demonstrations()] * len(PLACES), PLACES, PRIMITIVE)
    return (
        pd.concat([scores, *people], ignore_index=True),
        paths,
        pd.concat([_own(scored, person) for person in PEOPLE]),
    )


def _own(scored, person):
    """Scores of one person's demonstrations, whose pace differs between people and trials."""
    pace = 1.0 + 0.05 * person + 0.02 * scored["demonstration"]
    its = {"movement_s": pace * scored["movement_s"], "preference_m": 0.01 * person, "near": True}
    return scored.assign(person=person, **its)
