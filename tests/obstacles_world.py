"""A small obstacle testbed that has been evaluated: what the tests of its page and recordings look at."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd
from committed import committed
from obstacles_unrolls import baseline

from structlearn.avoidance.shapes import SHAPES, obstacle
from structlearn.core.params import Population
from structlearn.readers.demonstration import Demonstration
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.protocol.people import demonstration_scores
from structlearn.testbeds.obstacles.world.scenarios import Scenario, own_scenarios

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


def people():
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
    """Scores and paths of all situations with models of every kind, of three people who differ a little.

    With the scores of their demonstrations.
    """
    own, found = own_scenarios(PLACES, PEOPLE), []
    for person in PEOPLE:
        strength = 1.0 + 0.01 * person
        shapes = {shape: Push(4.0 * strength) for shape in SHAPES}
        models = {
            "network": {"setting": Push(5.0 * strength), "all": Push(3.0 * strength)} | shapes,
            "ensemble": {"all": Push(3.5 * strength)} | shapes,
            "human_inspired": {"setting": Push(9.0)} | shapes,
            "phase_modulated": {"all": Push(2.0)} | shapes if person == POPULATION.shown else {},
        }
        learner = avoidance_protocols.Learner(person, PRIMITIVE, models, own[person])
        for one in avoidance_protocols.situations(PLACES, PRIMITIVE, TESTED):
            found.append(avoidance_protocols.evaluate((learner, one), TESTED, POPULATION.shown))
    scores, paths = (pd.concat(parts, ignore_index=True) for parts in zip(*found, strict=True))
    scored = demonstration_scores([people()] * len(PLACES), PLACES, PRIMITIVE)
    return scores, paths, pd.concat([scored.assign(person=person) for person in PEOPLE])
