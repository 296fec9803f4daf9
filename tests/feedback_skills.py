"""Skills with made-up networks and sensors that the tests of the controller share."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from primitives_movements import reach, wobbly_turn

from structlearn.core import quaternion
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.skill import Limits, ReactiveSkill
from structlearn.primitives.orientation import fit_quaternion, fit_rhythmic_quaternion
from structlearn.primitives.position import fit_position, fit_rhythmic_position
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import differentiated, differentiated_orientation
from structlearn.primitives.vector import fit_expected_traces

NAMES = ("down", "tilt", "scrape")
POINTS = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.05], [0.3, 0.1, 0.05], [0.3, 0.3, 0.25]])
TURNS = (0.6, -0.5, 0.7)
DEMONSTRATED_DT = 0.01
CAUTIOUS = Limits()


def random_network(rng, inputs=6, hidden=(10,), kernels=25, size=1.0):
    """A network for counts of some tens whose coupling term is of the order of `size`."""
    sizes = [inputs, *hidden]
    layers = tuple(
        (rng.normal(0.0, max(before, 1) ** -0.5, (after, before)), rng.normal(0.0, 0.3, after))
        for before, after in pairwise(sizes)
    )
    return PhaseModulatedNetwork(
        input_mean=rng.normal(0.0, 10.0, inputs),
        input_scale=rng.uniform(5.0, 30.0, inputs),
        hidden=layers,
        phase_weights=rng.normal(0.0, max(sizes[-1], 1) ** -0.5, (kernels, sizes[-1])),
        phase_biases=rng.normal(0.0, 0.3, kernels),
        output_weights=rng.normal(0.0, size, kernels),
    )


def random_skill(rng, networks=None, channels=6, turned=True, limits=CAUTIOUS):
    """Three primitives with expected traces, without feedback but for the given networks by name and axis."""
    primitives, expected, base = [], {}, np.array([1.0, 0.0, 0.0, 0.0])
    for name, start, goal, turn in zip(NAMES, POINTS, POINTS[1:], TURNS, strict=False):
        duration = rng.uniform(0.4, 0.7)
        demonstrated = wobbly_turn(rng, turn, 0.1, duration, DEMONSTRATED_DT, base, rng.normal(size=3))
        base = demonstrated.orientation[-1]
        point = fit_position([reach(rng, start, goal, duration, DEMONSTRATED_DT, 0.02)], (True, False, False))
        primitives.append(PosePrimitive(name, point, fit_quaternion([demonstrated]) if turned else None))
        swing = np.sin(np.linspace(0.0, 3.0, 60)[:, None] * rng.uniform(0.5, 2.0, channels))
        expected[name] = fit_expected_traces([20.0 * swing], DEMONSTRATED_DT, 25.0)
    return ReactiveSkill(primitives, expected, networks or {}, limits)


def random_strokes(rng, networks=None, channels=6, cycles=2.0):
    """As `random_skill`, with strokes to and fro instead of `tilt`, which the traces accompany."""
    skill = random_skill(rng, channels=channels)
    before, after = skill.primitives[0], skill.primitives[2]
    rhythm, period = Rhythm(0.0, 1.5), rng.uniform(0.4, 0.7)
    share = np.arange(round(1.5 * period / DEMONSTRATED_DT) + 1)[:, None] * DEMONSTRATED_DT / period
    side = 0.5 - 0.5 * np.cos(2.0 * np.pi * share)
    point = differentiated(before.position.goal + side * (POINTS[2] - POINTS[1]), DEMONSTRATED_DT, 20.0)
    turns = quaternion.from_rotation_vector(side * rng.uniform(-0.2, 0.2, 3))
    turned = quaternion.product(turns, before.orientation.goal)
    turning = differentiated_orientation(turned, DEMONSTRATED_DT, 20.0)
    swing = 20.0 * np.sin(2.0 * np.pi * share) * rng.uniform(-1.0, 1.0, channels)
    strokes = PosePrimitive(
        "tilt", fit_rhythmic_position([point], [rhythm]), fit_rhythmic_quaternion([turning], [rhythm])
    )
    traces = fit_expected_traces([swing], DEMONSTRATED_DT, 25.0, [rhythm])
    return replace(
        skill,
        primitives=[before, strokes.repeated(cycles), after],
        expected=skill.expected | {"tilt": traces},
        networks=networks or {},
    )
