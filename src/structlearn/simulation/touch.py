"""What the wrist sensor and two BioTac-like fingers would read in a simulated demonstration.

No contact physics: force follows from "in contact or not", the tool's residual tilt and its motion; the
electrodes answer by a static map of pressure with lag and creep. Magnitudes are those of the recorded
scraping (public data of the same set-up): contact moves a few electrodes by 100-470 counts and the median one
by 10-30, later motion moves most by 3-20, and noise is 0.45-0.7 counts.
"""

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.distance import cdist

from structlearn.recordings.recording import Stream

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
CORE_RADIUS_MM = 5.08

# Board and tool
FORCE_N = 1.0  # downwards, the nominal scraping force
FORCE_SPREAD = 0.15  # between trials: people reproduce a light force poorly
FORCE_CV = 0.06  # within a trial: fluctuation proportional to the force (Jones, Hamilton & Wolpert 2002)
FORCE_FLUCTUATION_S = 0.15  # correlation time of it
LOADING_S = 0.25  # from first touch to full force
FRICTION = 0.2
FRICTION_SPEED_M_S = 2e-3  # tanh regularisation
ROLL_TORQUE_N_M_RAD = 0.025  # about the edge: 1.1 mN m at 2.5 degrees in a physical simulation
FORCE_NOISE_N, TORQUE_NOISE_N_M = 0.02, 2e-4  # of the wrist sensor

# Fingers
GRIP_N, GRIP_SPREAD = 4.0, 0.05
SHEAR_MM_N = 3.0  # the contact centre moves with shear
ROLLING_MM_RAD = 8.0  # and with the tool's rotation in the grasp
PRESSURE_MM = 2.6  # width of the pressure
SATURATION = 0.35  # p / (1 + 0.35 p), p in N
BULGE = 0.25  # displaced fluid lifts the skin elsewhere: opposite sign
CROSS_TALK, CROSS_TALK_MM = 0.05, 4.0
LAG_S = 0.06
CREEP, CREEP_S = 0.10, 4.0
COUNTS_PER_N = -330.0  # pressure lowers the counts
OFFSET_COUNTS = 30.0  # std between electrodes
NOISE_COUNTS = 0.6
JITTER_S = 2e-4  # std of the stamps of devices with clocks of their own


def sensor_streams(
    start: int,
    time: np.ndarray,
    contact: np.ndarray,
    tilt: np.ndarray,
    velocity: np.ndarray,
    rates_hz: tuple[float, float],
    rng: np.random.Generator,
) -> list[Stream]:
    """Wrench and tactile streams of one demonstration.

    The wrench is what the tool exerts on the board, base frame, torque about the edge.

    Args:
        start: stamp of time 0 in ns.
        time: (T,) s, uniform.
        contact: (T,) 0 in the air, 1 with the tool fully on the board.
        tilt: (T, 3) rad, rotation vector of the tool from flat, base frame.
        velocity: (T, 3) m/s of the edge without tremor (the elastic skin takes that up before the edge
            slips).
        rates_hz: of wrench and tactile.
        rng: of the sensors.

    Returns:
        One wrench stream, two tactile streams (left, right finger; 19 electrodes each).
    """
    wrench = _wrench(time, contact, tilt, velocity, rng)
    stamps, sample = _clock(start, time, rates_hz[0], rng)
    sensor_noise = rng.standard_normal((len(sample), 6)) * np.repeat([FORCE_NOISE_N, TORQUE_NOISE_N_M], 3)
    result = [Stream("/wrist/wrench", "wrench", stamps, _resample(sample, time, wrench) + sensor_noise)]

    grip = GRIP_N * (1 + GRIP_SPREAD * rng.standard_normal())
    for finger, side in (("left", 1.0), ("right", -1.0)):
        stamps, sample = _clock(start, time, rates_hz[1], rng)
        load, centre = _pad_contact(contact, tilt, wrench, grip, side, rng)
        counts = electrode_counts(
            _resample(sample, time, load[:, None])[:, 0], _resample(sample, time, centre), rates_hz[1], rng
        )
        result.append(Stream(f"/fingers/{finger}/electrodes", "tactile", stamps, counts))
    return result


def electrode_counts(
    load: np.ndarray, centre: np.ndarray, rate_hz: float, rng: np.random.Generator
) -> np.ndarray:
    """Counts of a finger's electrodes under one contact.

    Args:
        load: (N,) N, normal force on the pad.
        centre: (N, 2) mm, contact centre along x and around the pad (arc length, positive y).
        rate_hz: of the samples.
        rng: offsets and noise.

    Returns:
        (N, 19) whole counts.
    """
    angle = centre[:, 1] / CORE_RADIUS_MM
    point = np.stack([centre[:, 0], CORE_RADIUS_MM * np.sin(angle), -CORE_RADIUS_MM * np.cos(angle)], axis=1)
    distance = cdist(point, ELECTRODES_MM)  # (N, 19)
    pressure = load[:, None] * np.exp(-0.5 * (distance / PRESSURE_MM) ** 2)
    pressure = pressure / (1 + SATURATION * pressure)
    pressure = pressure - BULGE * pressure.mean(axis=1, keepdims=True)
    mixing = np.eye(19) + CROSS_TALK * np.exp(-cdist(ELECTRODES_MM, ELECTRODES_MM) / CROSS_TALK_MM)
    signal = COUNTS_PER_N * pressure @ mixing
    signal = _lagged(signal, LAG_S, rate_hz)
    signal = signal + CREEP * _lagged(signal, CREEP_S, rate_hz)
    offsets = OFFSET_COUNTS * rng.standard_normal(19)
    return np.round(offsets + signal + NOISE_COUNTS * rng.standard_normal(signal.shape))


def _wrench(
    time: np.ndarray, contact: np.ndarray, tilt: np.ndarray, velocity: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Force and torque of the tool on the board: (T, 6), without sensor noise."""
    dt = time[1] - time[0]
    level = FORCE_N * np.exp(FORCE_SPREAD * rng.standard_normal())
    fluctuation = _lagged(rng.standard_normal((len(time), 1)), FORCE_FLUCTUATION_S, 1 / dt)[:, 0]
    fluctuation *= FORCE_CV / fluctuation.std()
    normal = level * contact**2 * (3 - 2 * contact) * (1 + fluctuation)
    drag = FRICTION * normal[:, None] * np.tanh(velocity[:, :2] / FRICTION_SPEED_M_S)
    torque = ROLL_TORQUE_N_M_RAD * normal[:, None] * tilt
    return np.column_stack([drag, -normal, torque])


def _pad_contact(
    contact: np.ndarray,
    tilt: np.ndarray,
    wrench: np.ndarray,
    grip: float,
    side: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Load (T,) in N and contact centre (T, 2) in mm on the pad of one finger.

    The fingers point down and close along the base x axis: the board's reaction pushes the tool against the
    pads' x axis, its drag around them; roll turns the tool about the pad's normal, pitch loads one finger.
    Half of the shear and half of the tilt come to each finger; `side` is +1 for the left, -1 for the right.
    """
    home = np.array([-3.0, 0.0]) + rng.standard_normal(2) * [1.5, 0.8]  # the tool slips a little per trial
    reaction_up, drag = -wrench[:, 2], wrench[:, 1]
    turned = 0.5 * contact[:, None] * tilt  # in the soft grasp
    along = home[0] - 0.5 * SHEAR_MM_N * reaction_up + ROLLING_MM_RAD * side * turned[:, 1]
    around = home[1] - side * (0.5 * SHEAR_MM_N * drag + ROLLING_MM_RAD * turned[:, 0])
    load = grip * (1 + side * 2.0 * turned[:, 1])
    return load, np.stack([along, around], axis=1)


def _lagged(signal: np.ndarray, time_constant: float, rate_hz: float) -> np.ndarray:
    """First-order lag of the columns, settled at the first sample: (N, D), s, Hz -> (N, D)."""
    keep = np.exp(-1 / (time_constant * rate_hz))
    return lfilter([1 - keep], [1, -keep], signal, axis=0, zi=keep * signal[:1])[0]


def _clock(
    start: int, time: np.ndarray, rate_hz: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (N,) int64 ns, with a constant phase and jitter, and true sample times (N,) s of a device."""
    sample = np.arange(rng.uniform(0, 1 / rate_hz), time[-1], 1 / rate_hz)
    jitter = np.clip(JITTER_S * rng.standard_normal(len(sample)), -0.4 / rate_hz, 0.4 / rate_hz)
    return start + np.round((sample + jitter) * 1e9).astype(np.int64), sample


def _resample(sample: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Columns at other times, linearly: (N,), (T,), (T, D) -> (N, D)."""
    return np.stack([np.interp(sample, time, column) for column in values.T], axis=1)
