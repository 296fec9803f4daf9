"""Two BioTac-like fingers that pinch a tool: electrode counts, sample by sample.

The model goes from the wrench of the tool on the hand to 38 counts:

    wrench, turn -> load and shear of each pad -> contact point and load on the skin       (statics)
                 -> electrode counts                                           (see `electrode_response`)
                 -> noise, rounding

Pairs of fingers differ in the constants of `PinchParameters.between`, and their single electrodes among each
other; both are drawn from the sensor's seed. Grip force and the place of the tool belong to the grasp and are
drawn from the trial's generator.
"""

from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.simulation.electrode_response import (
    PLAY_N,
    Response,
    ResponseParameters,
    crept,
    draw_response,
    lagged,
    played,
    static_counts,
)
from structlearn.core.compilation import numba
from structlearn.tactile.electrodes import ELECTRODES_MM, SKIN_RADIUS_MM

CHANNELS = 2 * len(ELECTRODES_MM)

PAD_DISTANCE_MM = 10.0  # half the distance between the pads, d: the tool is 20 mm thick
HOME_MM = (-2.0, -3.0)  # unloaded contact centres along the fingers, from the tip's start: the pad's flat
HOME_ACROSS_MM = (0.0, 1.0)  # the same across the fingers; chosen, since two fingers never align exactly


class PinchParameters(ResponseParameters):
    """Two fingers pinching a tool."""

    grip_n: float = Field(gt=0)  # a 60 g tool pushed with 1 N does not slip at friction 0.5
    grip_spread: float = Field(ge=0)  # chosen: repeatability of a force-controlled gripper
    slip_mm: float = Field(ge=0)  # chosen small: the hand keeps the tool between runs, only slip moves it
    shear_mm_n: float = Field(ge=0)  # skin of 500 N/m: contact changes electrodes as much as recorded
    rolling_mm_rad: float = Field(ge=0)  # pads d off the axis take up most of d per radian by rolling
    twist_mm_n_m: float = Field(ge=0)  # as recorded, drag of the edge changes electrodes less than contact


PLAY_MM = np.array([0.03, 0.1, 0.3, 1.0])
"""Thresholds of the play operators on the contact centre, in steps of about three up to the largest
displacement, so that the relative width of a loop hardly depends on its size (like loss in rubber)."""


class FingerPair:
    """Two fingers pinching a tool, read at a constant rate; 38 counts per sample.

    Hand frame: x is the pinch axis with the left finger at +x, y the direction of scraping, z distal along
    the fingers. The first reading starts with the grasp settled under the wrench of that moment.
    """

    def __init__(
        self, parameters: PinchParameters, sensor_seed: int, trial: np.random.Generator, rate_hz: float
    ) -> None:
        """Grasp a tool; `sensor_seed`: of single electrodes; `trial`: of grip, place of the tool and noise.

        Raises ValueError: the rate is not positive.
        """
        if not rate_hz > 0:
            raise ValueError(f"rate must be positive, is {rate_hz} Hz")
        per_arm = 0.5 / (1e-3 * PAD_DISTANCE_MM)
        give = (parameters.shear_mm_n, parameters.rolling_mm_rad, parameters.twist_mm_n_m)
        self._hand = Hand(
            grasp=_grasp(parameters, trial),
            statics=np.array([per_arm, *give]),
            thresholds=np.stack([PLAY_N, PLAY_MM, PLAY_MM]),
            response=draw_response(parameters, ELECTRODES_MM, 2, np.random.default_rng(sensor_seed), rate_hz),
            play=np.zeros((2, 3, len(PLAY_MM))),
            creep=np.zeros((2, 3, len(parameters.creep))),
            lag=np.zeros((2, len(ELECTRODES_MM))),
            settled=np.zeros(1, dtype=bool),
        )
        self._noise_counts, self._trial = parameters.noise_counts, trial

    def read(self, force: np.ndarray, torque: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Next sample, (38,) counts, left finger first.

        `force` (3,) N and `torque` (3,) N m of the tool on the hand, about the grasp's centre; `turn` (3,)
        rad: rotation vector of the tool in the grasp; all in the hand frame. Raises ValueError: not finite.
        """
        return self.trace(*(np.asarray(part, dtype=float)[None] for part in (force, torque, turn)))[0]

    def trace(self, force: np.ndarray, torque: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Next T samples, (T, 38) counts, for inputs (T, 3) each; the same as repeated `read`."""
        samples = np.hstack([force, torque, turn]).astype(float)
        if not np.isfinite(samples).all():
            raise ValueError("fingers: force, torque and turn must be finite")
        noise = self._noise(len(samples))
        return np.rint(_respond(samples, self._hand) + noise)

    def readings(self, count: int) -> "Readings":
        """Next readings for a compiled loop that calls `take`; the same numbers as `read`."""
        return Readings(self._hand, self._noise(count))

    def _noise(self, count: int) -> np.ndarray:
        return self._noise_counts * self._trial.standard_normal((count, CHANNELS))


class Hand(NamedTuple):
    """Model of two fingers and their grasp; quantities of a pad: load N, along mm, across mm."""

    grasp: np.ndarray  # (2, 3) pad quantities with an unloaded tool
    statics: np.ndarray  # (4,) 1 / (2 d) in 1/m, shear mm/N, rolling mm/rad, twist mm/(N m)
    thresholds: np.ndarray  # (3, K) of play
    response: Response
    # state between samples, updated in place
    play: np.ndarray  # (2, 3, K)
    creep: np.ndarray  # (2, 3, M)
    lag: np.ndarray  # (2, 19)
    settled: np.ndarray  # (1,) whether there was a sample before


class Readings(NamedTuple):
    """The next readings of two fingers."""

    hand: Hand
    noise: np.ndarray  # (S, 38) counts


@numba.njit(cache=True)
def take(readings: Readings, number: int, sample: np.ndarray, counts: np.ndarray) -> None:
    """Write a reading (38,) of a sample (9,): force, torque and turn as in `FingerPair.read`; NaN allowed."""
    felt = _respond(sample.reshape((1, 9)), readings.hand)[0]
    for channel in range(len(counts)):
        counts[channel] = np.rint(felt[channel] + readings.noise[number, channel])


def _grasp(parameters: PinchParameters, rng: np.random.Generator) -> np.ndarray:
    """Load N, along mm and across mm of both pads for an unloaded tool, (2, 3)."""
    grip = parameters.grip_n * np.exp(parameters.grip_spread * rng.standard_normal())
    seat = np.column_stack([HOME_MM, HOME_ACROSS_MM])
    return np.column_stack([[grip, grip], seat + parameters.slip_mm * rng.standard_normal((2, 2))])


@numba.njit(cache=True)
def _respond(samples: np.ndarray, hand: Hand) -> np.ndarray:
    """Counts before noise (T, 38) for samples (T, 9); updates the state of the hand."""
    response = hand.response
    electrodes = len(response.electrodes)
    counts = np.empty((len(samples), 2 * electrodes))
    settled = hand.settled[0]
    for t in range(len(samples)):
        for finger in range(2):
            pushed = _pad(samples[t], finger, hand.grasp[finger, 0], hand.statics)
            for quantity in range(3):
                play, creep = hand.play[finger, quantity], hand.creep[finger, quantity]
                value = played(pushed[quantity], hand.thresholds[quantity], response.hysteresis, play)
                pushed[quantity] = crept(value, response.creep, response.creep_keep, settled, creep)
            pushed[1:] += hand.grasp[finger, 1:]
            signal = static_counts(pushed[0], _on_skin(pushed[1], pushed[2]), finger, response)
            lag = hand.lag[finger]
            lagged(signal, response.lag_keep, settled, lag)
            counts[t, finger * electrodes : (finger + 1) * electrodes] = lag + response.offset[finger]
        settled = True
    hand.settled[0] = settled
    return counts


@numba.njit(cache=True)
def _pad(sample: np.ndarray, finger: int, grip: float, statics: np.ndarray) -> np.ndarray:
    """Load in N of one pad, and displacement of its contact centre along and across the finger in mm.

    Two pads at x = +-d carry the force and, with equal and opposite shear, the torque about y and z. The
    finger's own y axis is -y of the hand for the left finger, +y for the right one.
    """
    side = 1.0 if finger == 0 else -1.0
    per_arm, shear, rolling, twist = statics
    load = max(grip + side * sample[0] / 2, 0.0)
    force_along = sample[2] / 2 - side * sample[4] * per_arm
    force_across = sample[1] / 2 + side * sample[5] * per_arm
    along = shear * force_along - side * rolling * sample[7]
    across = shear * force_across + side * rolling * sample[8] - twist * sample[3] - rolling * sample[6]
    return np.array([load, along, -side * across])


@numba.njit(cache=True)
def _on_skin(along: float, across: float) -> np.ndarray:
    """Point of the skin in the finger frame, mm, at arc lengths along and across the pad."""
    around = across / SKIN_RADIUS_MM
    over = min(max(along, 0.0) / SKIN_RADIUS_MM, np.pi / 2)
    return np.array(
        [
            SKIN_RADIUS_MM * np.sin(over) if along > 0 else along,
            SKIN_RADIUS_MM * np.cos(over) * np.sin(around),
            -SKIN_RADIUS_MM * np.cos(over) * np.cos(around),
        ]
    )
