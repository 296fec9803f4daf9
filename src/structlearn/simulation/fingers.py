"""Two BioTac-like fingers that pinch a tool: what their electrodes count, sample by sample.

The model goes from the wrench of the tool on the hand to 38 counts in five steps, each a known effect of a
fluid-filled finger (Wettels et al. 2008, Biomimetic tactile sensor array, Advanced Robotics 22; Lin et al.
2013, ICRA) with a silicone skin (Case et al. 2015, Soft Robotics 2; Romano et al. 2024, Soft Science 4:31):

    wrench, turn -> load and shear of each pad -> where and how hard the skin is pressed   (statics)
                 -> hysteresis: the skin sticks and slips, rate-independent                (play operators)
                 -> creep: the skin gives way slowly                                       (Prony series)
                 -> thinner fluid over the pressed electrodes, bulge elsewhere             (static map)
                 -> lag of the fluid, offsets, noise, whole counts

What tells one electrode from another belongs to the sensor and is drawn from the sensor's seed; grip force
and where the tool sits belong to the grasp and are drawn from the trial's generator. Drift with temperature
is left out: in the recorded runs of 10 s quiet electrodes do not move beyond their noise.
"""

from typing import NamedTuple

import numba
import numpy as np
from pydantic import Field

from structlearn.params import Parameters

# Electrodes 1-19 in mm: x towards the finger tip, z into the finger (published driver code of the sensor).
_SIDE = [
    (0.993, -4.855, -1.116),
    (-2.7, -3.513, -3.67),
    (-6.2, -3.513, -3.67),
    (-8.0, -4.956, -1.116),
    (-10.5, -3.513, -3.67),
    (-13.4, -4.956, -1.116),
]
ELECTRODES_MM = np.array(
    _SIDE
    + [(4.763, 0, -2.33), (3.031, -1.95, -3.33), (3.031, 1.95, -3.33), (1.299, 0, -4.33)]
    + [(x, -y, z) for x, y, z in _SIDE]
    + [(-2.8, 0, -5.08), (-9.8, 0, -5.08), (-13.6, 0, -5.08)]
)
SKIN_RADIUS_MM = 7.0
"""Of the outer skin: half cylinder behind the tip (x <= 0), quarter sphere at the tip."""

CHANNELS = 2 * len(ELECTRODES_MM)


class TouchParameters(Parameters):
    """The two fingers; the defaults are those of the robot here.

    Where a value rests on the recorded scraping execution of the public data (`clmc`), the calibration report
    shows both beside each other.

    Attributes:
        grip_n: force of the pinch; chosen so that a 60 g tool pushed with 1 N does not slip at friction 0.5.
        grip_spread: its standard deviation between trials, relative; chosen as what a force-controlled
            gripper repeats.
        pad_distance_mm: half the distance between the pads, d: a tool 20 mm thick.
        home_mm: contact centre of the left and the right finger along the finger when nothing pulls at the
            tool, from the start of the round tip; chosen where the flat of the pad is.
        home_across_mm: the same across the finger; chosen since two fingers never meet exactly.
        slip_mm: standard deviation between trials of where the tool sits, per finger and direction; chosen
            small: the hand keeps the tool between runs, only slip moves it.
        shear_mm_n: how far shear moves the contact centre, as if the skin were a layer of 500 N/m; so that
            contact with the board and scraping move the electrodes about as far as recorded.
        rolling_mm_rad: how far a turn of the tool moves it; pads that are d off the axis take most of d per
            radian up by rolling.
        twist_mm_n_m: how far torque about the pinch axis moves it across the finger; small, since in the
            recording the drag of the scraped edge moves the electrodes far less than contact does.
        width_mm: standard deviation of the pressure that an electrode feels from a point contact; spatial
            resolution is below 2 mm (Wettels et al. 2008), and contact then moves as few electrodes as
            recorded.
        hertz_mm_n: radius of the contact patch under 1 N; it grows with the cube root of the load (Hertz).
        saturation_1_n: pressure p counts as p / (1 + saturation p): fluid cannot be thinner than nothing, and
            impedance rises from 5 to 1000 kOhm over 0.1 to 30 N (Wettels et al. 2008), less than the load.
        counts_per_n: change by pressure; the sensor's counts fall where fluid is thinned. Size: so that
            contact moves the strongest electrode of a finger as recorded (130 and 430 counts).
        bulge: share of the lost thickness that comes back over the whole finger, for the fluid's volume
            stays; chosen so that distant electrodes move by a few counts, the other way.
        bulge_n: load at which the bulge has reached 1 - 1/e of that.
        cross_talk: share of a neighbour's signal in an electrode's, at no distance: the fluid conducts.
        cross_talk_mm: distance over which it falls to 1/e; about the distance between electrodes.
        gain_spread: standard deviation of the log of an electrode's gain: electrodes are hand-made
            individuals; chosen.
        width_spread: the same of its width.
        bulge_spread: the same of its bulge.
        offset_counts: standard deviation of an electrode's zero; as recorded after taring, tens of counts.
        hysteresis: share of the deformation that goes through play operators; with the creep it makes loops
            4 to 7 % as wide as the reading's range, at 0.01 to 1 Hz. Silicone sensors in compression show 3
            to 4 % at 0.1 Hz and 9 to 15 % at 1 Hz (Romano et al. 2024); here the lag does the latter.
        creep: share of the deformation that comes late, per time constant; 12 % in all. Silicone relaxes
            under constant strain (Case et al. 2015); chosen, since no figure is published for this skin.
        creep_s: time constants of the creep; the fast one after the recovery time of silicone domes, 0.4 s
            (Romano et al. 2024); the slow one is chosen, about the length of a run.
        lag_s: of an electrode behind the pressure; in the recorded unscrewing the electrodes under the load
            follow the sensor's own fluid pressure by 20 to 70 ms.
        noise_counts: standard deviation of the white noise before rounding; recorded 0.45 to 0.7 with it.
    """

    grip_n: float = Field(default=4.0, gt=0)
    grip_spread: float = Field(default=0.05, ge=0)
    pad_distance_mm: float = Field(default=10.0, gt=0)
    home_mm: tuple[float, float] = (-2.0, -3.0)
    home_across_mm: tuple[float, float] = (0.0, 1.0)
    slip_mm: float = Field(default=0.15, ge=0)
    shear_mm_n: float = Field(default=2.0, ge=0)
    rolling_mm_rad: float = Field(default=8.0, ge=0)
    twist_mm_n_m: float = Field(default=20.0, ge=0)
    width_mm: float = Field(default=1.5, gt=0)
    hertz_mm_n: float = Field(default=1.3, ge=0)
    saturation_1_n: float = Field(default=0.35, ge=0)
    counts_per_n: float = Field(default=-1200.0, lt=0)
    bulge: float = Field(default=0.15, ge=0)
    bulge_n: float = Field(default=3.0, gt=0)
    cross_talk: float = Field(default=0.05, ge=0)
    cross_talk_mm: float = Field(default=4.0, gt=0)
    gain_spread: float = Field(default=0.35, ge=0)
    width_spread: float = Field(default=0.1, ge=0)
    bulge_spread: float = Field(default=0.2, ge=0)
    offset_counts: float = Field(default=30.0, ge=0)
    hysteresis: float = Field(default=0.15, ge=0, le=1)
    creep: tuple[float, float] = (0.05, 0.07)
    creep_s: tuple[float, float] = (0.4, 10.0)
    lag_s: float = Field(default=0.06, gt=0)
    noise_counts: float = Field(default=0.6, ge=0)


PLAY_MM = np.array([0.03, 0.1, 0.3, 1.0])
"""Thresholds of the play operators on the contact centre: in steps of about three from what can just be felt
to the largest displacement, so that a loop's width stays about the same share of its length (as rubber's
loss does) whatever its size."""

PLAY_N = np.array([0.03, 0.1, 0.3, 1.0])
"""The same for the load."""


class FingerPair:
    """Two fingers that pinch a tool, read at a constant rate; 38 counts per sample.

    Hand frame: x is the pinch axis with the left finger at +x, y the direction of scraping, z distal along
    the fingers. The first reading finds the grasp settled under the wrench of that moment.
    """

    def __init__(
        self, parameters: TouchParameters, sensor_seed: int, trial: np.random.Generator, rate_hz: float
    ) -> None:
        """Take a grasp.

        Args:
            parameters: see there.
            sensor_seed: of what tells one electrode from another; the same for all runs of a robot.
            trial: of grip, seat of the tool and noise.
            rate_hz: of the readings.

        Raises:
            ValueError: the rate is not positive.
        """
        if not rate_hz > 0:
            raise ValueError(f"rate must be positive, is {rate_hz} Hz")
        self._sensor = _sensor(parameters, np.random.default_rng(sensor_seed), rate_hz)
        self._grasp = _grasp(parameters, trial)
        self._noise_counts = parameters.noise_counts
        self._trial = trial
        self._memory = _Memory(
            np.zeros((2, 3, len(PLAY_MM))), np.zeros((2, 3, len(parameters.creep))), np.zeros((2, 19))
        )
        self._settled = False

    def read(self, force: np.ndarray, torque: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The next sample.

        Args:
            force: (3,) N that the tool exerts on the hand, hand frame.
            torque: (3,) N m about the grasp's centre, the same.
            turn: (3,) rad, rotation vector of the tool in the grasp, hand frame.

        Returns:
            (38,) whole counts, left finger first.

        Raises:
            ValueError: a number is not finite.
        """
        sample = np.empty((1, 9))
        sample[0, :3], sample[0, 3:6], sample[0, 6:] = force, torque, turn
        return self._read(sample)[0]

    def trace(self, force: np.ndarray, torque: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The next T samples at once, the same numbers as `read` one by one.

        Args:
            force: (T, 3) as for `read`; so are `torque` and `turn`.
            torque: (T, 3).
            turn: (T, 3).

        Returns:
            (T, 38) whole counts.

        Raises:
            ValueError: a number is not finite.
        """
        return self._read(np.hstack([force, torque, turn]).astype(float))

    def _read(self, samples: np.ndarray) -> np.ndarray:
        """Counts (T, 38) of samples (T, 9)."""
        if not np.isfinite(samples).all():
            raise ValueError("fingers: force, torque and turn must be finite")
        noise = self._noise_counts * self._trial.standard_normal((len(samples), CHANNELS))
        signal = _respond(samples, self._settled, self._grasp, self._sensor, self._memory)
        self._settled = True
        return np.rint(signal + noise)


class _Sensor(NamedTuple):
    """What stays with the robot; M time constants of creep."""

    statics: np.ndarray  # (4,) 1 / (2 d) in 1/m, shear mm/N, rolling mm/rad, twist mm/(N m)
    electrodes: np.ndarray  # (19, 3) mm
    gain: np.ndarray  # (2, 19) counts/N
    variance: np.ndarray  # (2, 19) mm^2 of the pressure under a point contact
    hertz: float  # mm at 1 N
    saturation: float  # 1/N
    bulge: np.ndarray  # (2, 19) counts
    bulge_load: float  # N
    mixing: np.ndarray  # (19, 19)
    offset: np.ndarray  # (2, 19) counts
    play: np.ndarray  # (3, K) thresholds in N, mm, mm
    hysteresis: float
    creep: np.ndarray  # (M,)
    creep_keep: np.ndarray  # (M,) share that stays over one sample
    lag_keep: float


class _Memory(NamedTuple):
    """State between samples, changed in place; quantities: load N, along mm, across mm."""

    play: np.ndarray  # (2, 3, K)
    creep: np.ndarray  # (2, 3, M)
    lag: np.ndarray  # (2, 19)


def _sensor(parameters: TouchParameters, rng: np.random.Generator, rate_hz: float) -> _Sensor:
    size = (2, len(ELECTRODES_MM))
    gain = parameters.counts_per_n * np.exp(parameters.gain_spread * rng.standard_normal(size))
    width = parameters.width_mm * np.exp(parameters.width_spread * rng.standard_normal(size))
    bulge = parameters.bulge * np.exp(parameters.bulge_spread * rng.standard_normal(size))
    offset = parameters.offset_counts * rng.standard_normal(size)
    distance = np.linalg.norm(ELECTRODES_MM[:, None] - ELECTRODES_MM, axis=2)
    talk = parameters.cross_talk * np.exp(-distance / parameters.cross_talk_mm)
    np.fill_diagonal(talk, 0.0)
    return _Sensor(
        statics=np.array(
            [
                0.5 / (1e-3 * parameters.pad_distance_mm),
                parameters.shear_mm_n,
                parameters.rolling_mm_rad,
                parameters.twist_mm_n_m,
            ]
        ),
        electrodes=ELECTRODES_MM,
        gain=gain,
        variance=width**2,
        hertz=parameters.hertz_mm_n,
        saturation=parameters.saturation_1_n,
        bulge=gain * bulge,
        bulge_load=parameters.bulge_n,
        mixing=np.eye(len(ELECTRODES_MM)) + talk,
        offset=offset,
        play=np.stack([PLAY_N, PLAY_MM, PLAY_MM]),
        hysteresis=parameters.hysteresis,
        creep=np.array(parameters.creep),
        creep_keep=np.exp(-1 / (np.array(parameters.creep_s) * rate_hz)),
        lag_keep=float(np.exp(-1 / (parameters.lag_s * rate_hz))),
    )


def _grasp(parameters: TouchParameters, rng: np.random.Generator) -> np.ndarray:
    """Load N, along mm, across mm of both pads with nothing pulling at the tool: (2, 3)."""
    grip = parameters.grip_n * np.exp(parameters.grip_spread * rng.standard_normal())
    seat = np.column_stack([parameters.home_mm, parameters.home_across_mm])
    return np.column_stack([[grip, grip], seat + parameters.slip_mm * rng.standard_normal((2, 2))])


@numba.njit(cache=True)
def _respond(
    samples: np.ndarray, settled: bool, grasp: np.ndarray, sensor: _Sensor, memory: _Memory
) -> np.ndarray:
    """Counts before noise, (T, 38), of samples (T, 9); `memory` moves on."""
    electrodes = len(sensor.electrodes)
    counts = np.empty((len(samples), 2 * electrodes))
    for t in range(len(samples)):
        for finger in range(2):
            pushed = _pad(samples[t], finger, grasp[finger, 0], sensor.statics)
            for quantity in range(3):
                value = _played(
                    pushed[quantity], sensor.play[quantity], sensor.hysteresis, memory.play[finger, quantity]
                )
                pushed[quantity] = _crept(
                    value, sensor.creep, sensor.creep_keep, settled, memory.creep[finger, quantity]
                )
            pushed[1:] += grasp[finger, 1:]
            signal = _static_counts(pushed, finger, sensor)
            lag = memory.lag[finger]
            if settled:
                lag[:] = signal + sensor.lag_keep * (lag - signal)
            else:
                lag[:] = signal
            counts[t, finger * electrodes : (finger + 1) * electrodes] = lag + sensor.offset[finger]
        settled = True
    return counts


@numba.njit(cache=True)
def _pad(sample: np.ndarray, finger: int, grip: float, statics: np.ndarray) -> np.ndarray:
    """Load in N, and displacement of the contact centre along and across the finger in mm, of one pad.

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
def _played(value: float, thresholds: np.ndarray, share: float, state: np.ndarray) -> float:
    """Prandtl-Ishlinskii hysteresis: a sum of play operators, which follow only when pushed; from rest."""
    total = 0.0
    for k in range(len(thresholds)):
        state[k] = min(max(state[k], value - thresholds[k]), value + thresholds[k])
        total += state[k]
    return (1 - share) * value + share * total / len(thresholds)


@numba.njit(cache=True)
def _crept(value: float, shares: np.ndarray, keeps: np.ndarray, settled: bool, state: np.ndarray) -> float:
    """Creep compliance 1 + sum_m share_m (1 - exp(-t / tau_m)), scaled to 1 at the end."""
    late = 0.0
    total = 0.0
    for m in range(len(shares)):
        state[m] = value + keeps[m] * (state[m] - value) if settled else value
        late += shares[m] * state[m]
        total += shares[m]
    return (1 - total) * value + late


@numba.njit(cache=True)
def _static_counts(pushed: np.ndarray, finger: int, sensor: _Sensor) -> np.ndarray:
    """Change of the counts, (19,), by a contact of load N at a place along and across the finger (mm)."""
    load = max(pushed[0], 0.0)
    place = _on_skin(pushed[1], pushed[2])
    patch = (sensor.hertz**2 * load ** (2 / 3)) / 2
    bulge = 1 - np.exp(-load / sensor.bulge_load)
    own = np.empty(len(sensor.electrodes))
    for electrode in range(len(own)):
        square = ((sensor.electrodes[electrode] - place) ** 2).sum()
        pressure = load * np.exp(-square / (2 * (sensor.variance[finger, electrode] + patch)))
        own[electrode] = (
            sensor.gain[finger, electrode] * pressure / (1 + sensor.saturation * pressure)
            - sensor.bulge[finger, electrode] * bulge
        )
    mixed = np.zeros(len(own))
    for target in range(len(own)):
        for source in range(len(own)):
            mixed[target] += sensor.mixing[target, source] * own[source]
    return mixed


@numba.njit(cache=True)
def _on_skin(along: float, across: float) -> np.ndarray:
    """Point of the skin, finger frame in mm, at arc lengths along and across the pad."""
    around = across / SKIN_RADIUS_MM
    over = min(max(along, 0.0) / SKIN_RADIUS_MM, np.pi / 2)
    return np.array(
        [
            SKIN_RADIUS_MM * np.sin(over) if along > 0 else along,
            SKIN_RADIUS_MM * np.cos(over) * np.sin(around),
            -SKIN_RADIUS_MM * np.cos(over) * np.cos(around),
        ]
    )
