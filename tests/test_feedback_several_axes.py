"""From corrected demonstrations on two axes, felt by fingers and wrench, to a controller that corrects so."""

import numpy as np
import pandas as pd
import pytest
from committed import committed
from scraping_motions import minimum_jerk, turn

from structlearn.feedback.feedback_models import POINTWISE, FeedbackParameters, train_models
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Limits, ReactiveSkill, demonstrated_limits
from structlearn.feedback.supervision import (
    CorrectionParameters,
    coupling_dataset,
    learn_expected,
    sensor_channels,
)
from structlearn.ground import quaternion
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration

DT, DURATION, REST = 1 / 100, 2.0, 0.5
AXES = ("z", "ry")
SENSORS = ("tactile", "wrench")
SETTINGS = {"low": (0.5, 1.0), "high": (1.0, -1.0), "-3": (1.5, 0.5), "3": (-0.5, -0.5), "left": (-1.0, 1.0)}
"""By label, how large what is felt and corrected is: along z, about y."""

PARAMETERS = CorrectionParameters(
    primitives=("carry",), axes=AXES, sensors=SENSORS, smoothing_hz=10.0, target_hz=8.0, rate_hz=100.0
)


@pytest.fixture(scope="module")
def primitive():
    reach = minimum_jerk([0.0, 0.0, 0.1], [0.2, 0.1, 0.1], DURATION)
    swing = turn([0.0, 0.0, 0.0], [0.0, np.radians(20.0), 0.0], DURATION)
    return PosePrimitive("carry", fit_position([reach]), fit_quaternion([swing]))


def bump(s):
    """Smooth, 0 outside of a movement."""
    s = np.clip(s, 0.0, 1.0)
    return 64 * s**3 * (1 - s) ** 3


def felt(time, gains, rng):
    """Fingers (T, 4) in counts and wrench (T, 6) in N and N m, each feeling both disturbances and noise."""
    shift, tilt = (gain * bump((time - REST) / DURATION) for gain in gains)
    fingers = 300.0 + 40.0 * np.column_stack([shift, shift - tilt, tilt, 0.0 * tilt])
    wrench = np.column_stack([5.0 * shift, tilt, 0.0 * tilt, 0.02 * tilt, -0.1 * shift, 0.0 * tilt])
    noise = rng.normal(size=(len(time), 10)) * np.repeat([0.5, 0.05, 0.001], [4, 3, 3])
    return fingers + noise[:, :4], wrench + noise[:, 4:]


def asked(time, gains):
    """Coupling terms (T, 2) that are right: m along z, rad about y."""
    s = (time - REST) / DURATION
    return np.column_stack([3.0 * gains[0] * bump(s), -8.0 * gains[1] * bump(s)])


def unrolled(primitive, gains):
    """Time, and the pose that is right, at rest before and after."""
    time = DT * np.arange(round((DURATION + 2 * REST) / DT) + 1)
    rows, c = np.maximum(np.arange(len(time)) - round(REST / DT), 0), asked(time, gains)[round(REST / DT) :]
    rest = {"velocity": 0.0, "acceleration": 0.0, "until": time[-1] - REST}
    shift = c[:, :1] * [0.0, 0.0, 1.0]  # the reach is level: its local z is the base frame's
    point = primitive.position.unroll(DT, coupling=lambda k, x, xd: shift[k], **rest)
    turned = primitive.orientation.unroll(DT, coupling=lambda k, q, w: [0.0, c[k, 1], 0.0], **rest)
    return time, point.position[rows], turned.orientation[rows]


def demonstration(primitive, name, gains, rng):
    time, position, orientation = unrolled(primitive, gains)
    fingers, wrench = felt(time, gains, rng)
    return Demonstration(name, time, position, orientation, tactile=fingers, wrench=wrench)


def cut(runs):
    segment = [REST, REST + DURATION]
    return pd.DataFrame([segment] * len(runs), index=[run.name for run in runs], columns=["start_s", "end_s"])


@pytest.fixture(scope="module")
def skill(primitive):
    rng = np.random.default_rng(0)
    sets = {
        label: [demonstration(primitive, f"{number}", gains, rng) for number in range(3)]
        for label, gains in ({"nominal": (0.0, 0.0)} | SETTINGS).items()
    }
    cuts = {label: cut(runs) for label, runs in sets.items()}
    executions = sets.pop("nominal")
    expected = learn_expected(executions, {"carry": cuts["nominal"]}, 6.0, SENSORS)
    datasets, _ = coupling_dataset(sets, cuts, primitive, expected["carry"], PARAMETERS)
    training = committed(FeedbackParameters, "train_feedback", hidden=())
    steps = training.pointwise.model_copy(update={"steps": 1500, "dropout": 0.0, "learning_rate": 3e-3})
    training = training.model_copy(update={"pointwise": steps})
    trained = train_models(datasets, {}, training, (POINTWISE,))[POINTWISE]
    limits = demonstrated_limits({axis: [its.target] for axis, its in datasets.items()}, Limits())
    return ReactiveSkill(
        [primitive], expected, {"carry": dict(trained)}, limits, None, sensor_channels(SENSORS, expected)
    )


def test_every_sensor_has_a_scale_of_its_own(skill):
    """Counts, N and N m: what a network feels is of the order of 1 in each."""
    assert skill.sensors == (("tactile", 4), ("wrench", 6))
    for network in skill.networks["carry"].values():
        scales = np.split(network.input_scale, [4, 7])
        assert all((scale == scale[0]).all() for scale in scales)
        assert scales[0][0] > 5.0 > 2.0 > scales[1][0] > 0.2 > 0.1 > scales[2][0]


@pytest.mark.parametrize("gains", [(0.75, 0.0), (0.0, 0.75), (1.2, -0.4), (0.0, 0.0)])
def test_what_nobody_has_shown_is_corrected_on_each_axis(skill, primitive, gains):
    _, position, orientation = unrolled(primitive, gains)
    first = round(REST / DT)
    fingers, wrench = felt(DT * np.arange(len(position)), gains, np.random.default_rng(1))
    samples = np.column_stack([fingers, wrench])
    errors, corrections = [], []
    for feedback, differences in ((True, errors), (False, corrections)):
        controller = Controller(skill, 1 / DT, feedback=feedback)
        controller.start(position[first], orientation[first])
        for k in range(first, first + round(DURATION / DT)):
            controller.tick(samples[k])
            turned = quaternion.difference(orientation[k], controller.orientation)
            differences.append([*(position[k] - controller.position), *turned])
    wrong, right = (np.sqrt(np.mean(np.square(rows), axis=0)) for rows in (errors, corrections))
    for place, gain, smallest in ((2, gains[0], 3e-4), (4, gains[1], np.radians(0.05))):
        assert wrong[place] < max(0.1 * right[place], smallest)
        assert (right[place] > 2 * smallest) == (gain != 0.0)
