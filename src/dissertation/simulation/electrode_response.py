"""Electrode counts of a finger whose skin is pressed at a point, for all testbeds with touch.

The model has the known effects of a fluid-filled finger (Wettels et al. 2008, Biomimetic tactile sensor
array, Advanced Robotics 22; Lin et al. 2013, ICRA) with a silicone skin (Case et al. 2015, Soft Robotics 2;
Romano et al. 2024, Soft Science 4:31):

    hysteresis: the skin sticks and slips, rate-independent                (play operators)
    -> creep: the skin yields slowly                                       (Prony series)
    -> thinner fluid over the pressed electrodes, bulge elsewhere          (static map)
    -> lag of the fluid, offsets; callers add noise and rounding

Sensors differ in the constants of `ResponseParameters.between`, and their single electrodes among each other.
Functions take one sensor, as drawn by `individuals.drawn`. Drift with temperature is left out: in
recorded runs of 10 s, idle electrodes stay within their noise.
"""

from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.simulation.individuals import Individual
from structlearn.core.compilation import numba


class ResponseParameters(Individual):
    """Electrodes of a finger; the comments give reasons and sources of the values in `params.yaml`.

    The page of the set `biotac` compares the recorded scraping execution (`clmc`) with simulated ones.
    """

    # spatial resolution is below 2 mm (Wettels et al. 2008); contact affects as few electrodes as recorded
    width_mm: float = Field(gt=0)
    hertz_mm_n: float = Field(ge=0)  # contact radius grows with the cube root of the load (Hertz)
    saturation_1_n: float = Field(ge=0)  # 5 to 1000 kOhm over 0.1 to 30 N (Wettels et al. 2008)
    counts_per_n: float = Field(lt=0)  # changes the strongest electrode as recorded (130 and 430 counts)
    bulge: float = Field(ge=0)  # the fluid's volume is constant: distant electrodes change the other way
    bulge_n: float = Field(gt=0)
    cross_talk: float = Field(ge=0)  # the fluid conducts
    cross_talk_mm: float = Field(gt=0)  # about the distance between electrodes
    gain_spread: float = Field(ge=0)  # electrodes are hand-made and differ; value chosen
    width_spread: float = Field(ge=0)
    bulge_spread: float = Field(ge=0)
    offset_counts: float = Field(ge=0)  # as recorded after taring, tens of counts
    # play operators and creep together give loops 4 to 7 % as wide as the reading's range, at 0.01 to 1 Hz.
    # Silicone sensors in compression show 3 to 4 % at 0.1 Hz and 9 to 15 % at 1 Hz (Romano et al. 2024); here
    # the latter comes from the lag
    hysteresis: float = Field(ge=0, le=1)
    # 12 % in all: silicone relaxes under constant strain (Case et al. 2015); none is published for this skin
    creep: tuple[float, float]
    # recovery time of silicone domes, 0.4 s (Romano et al. 2024), and about the length of a run
    creep_s: tuple[float, float]
    # in the recorded unscrewing, electrodes under the load follow the fluid pressure by 20 to 70 ms
    lag_s: float = Field(gt=0)
    noise_counts: float = Field(ge=0)  # before rounding; with rounding 0.45 to 0.7 as recorded


PLAY_N = np.array([0.03, 0.1, 0.3, 1.0])  # thresholds of the play operators on the load


class Response(NamedTuple):
    """Response of F fingers with E electrodes each, with M time constants of creep."""

    electrodes: np.ndarray  # (E, 3) mm
    gain: np.ndarray  # (F, E) counts/N
    variance: np.ndarray  # (F, E) mm^2, of the pressure under a point contact
    hertz: float  # mm at 1 N
    saturation: float  # 1/N
    bulge: np.ndarray  # (F, E) counts
    bulge_load: float  # N
    mixing: np.ndarray  # (E, E)
    offset: np.ndarray  # (F, E) counts
    hysteresis: float
    creep: np.ndarray  # (M,)
    creep_keep: np.ndarray  # (M,) share that remains after one sample
    lag_keep: float


def draw_response(
    parameters: ResponseParameters,
    electrodes_mm: np.ndarray,
    fingers: int,
    rng: np.random.Generator,
    rate_hz: float,
) -> Response:
    """Draw the electrodes of a sensor with F fingers at (E, 3) mm, sampled at `rate_hz`."""
    size = (fingers, len(electrodes_mm))
    means = (parameters.counts_per_n, parameters.width_mm, parameters.bulge)
    spreads = (parameters.gain_spread, parameters.width_spread, parameters.bulge_spread)
    gain, width, bulge = (
        mean * np.exp(spread * rng.standard_normal(size)) for mean, spread in zip(means, spreads, strict=True)
    )
    offset = parameters.offset_counts * rng.standard_normal(size)
    distance = np.linalg.norm(electrodes_mm[:, None] - electrodes_mm, axis=2)
    talk = parameters.cross_talk * np.exp(-distance / parameters.cross_talk_mm)
    np.fill_diagonal(talk, 0.0)
    return Response(
        electrodes=electrodes_mm,
        gain=gain,
        variance=width**2,
        hertz=parameters.hertz_mm_n,
        saturation=parameters.saturation_1_n,
        bulge=gain * bulge,
        bulge_load=parameters.bulge_n,
        mixing=np.eye(len(electrodes_mm)) + talk,
        offset=offset,
        hysteresis=parameters.hysteresis,
        creep=np.array(parameters.creep),
        creep_keep=np.exp(-1 / (np.array(parameters.creep_s) * rate_hz)),
        lag_keep=float(np.exp(-1 / (parameters.lag_s * rate_hz))),
    )


@numba.njit(cache=True)
def played(value: float, thresholds: np.ndarray, share: float, state: np.ndarray) -> float:
    """Prandtl-Ishlinskii hysteresis, a sum of play operators with `thresholds` (K,); updates `state` (K,)."""
    total = 0.0
    for k in range(len(thresholds)):
        state[k] = min(max(state[k], value - thresholds[k]), value + thresholds[k])
        total += state[k]
    return (1 - share) * value + share * total / len(thresholds)


@numba.njit(cache=True)
def crept(value: float, shares: np.ndarray, keeps: np.ndarray, settled: bool, state: np.ndarray) -> float:
    """Creep compliance 1 + sum_m share_m (1 - exp(-t / tau_m)), scaled to 1 in the limit.

    `keeps` (M,): share of the state that remains after one sample; `settled`: False starts in the limit;
    updates `state` (M,).
    """
    late = 0.0
    total = 0.0
    for m in range(len(shares)):
        state[m] = value + keeps[m] * (state[m] - value) if settled else value
        late += shares[m] * state[m]
        total += shares[m]
    return (1 - total) * value + late


@numba.njit(cache=True, fastmath={"contract", "reassoc"})
def static_counts(load: float, place: np.ndarray, finger: int, response: Response) -> np.ndarray:
    """Change of the counts (E,) due to a load in N at a point (3,) of the skin in mm."""
    load = max(load, 0.0)
    patch = (response.hertz**2 * load ** (2 / 3)) / 2
    bulge = 1 - np.exp(-load / response.bulge_load)
    own = np.empty(len(response.electrodes))
    for electrode in range(len(own)):
        square = 0.0
        for axis in range(3):
            square += (response.electrodes[electrode, axis] - place[axis]) ** 2
        pressure = load * np.exp(-square / (2 * (response.variance[finger, electrode] + patch)))
        own[electrode] = (
            response.gain[finger, electrode] * pressure / (1 + response.saturation * pressure)
            - response.bulge[finger, electrode] * bulge
        )
    mixed = np.zeros(len(own))
    for target in range(len(own)):
        for source in range(len(own)):
            mixed[target] += response.mixing[target, source] * own[source]
    return mixed


@numba.njit(cache=True)
def lagged(signal: np.ndarray, keep: float, settled: bool, state: np.ndarray) -> None:
    """First-order lag: move `state` (E,) towards the signal (E,); if not `settled`, set it at once."""
    for electrode in range(len(signal)):
        left = keep * (state[electrode] - signal[electrode]) if settled else 0.0
        state[electrode] = signal[electrode] + left
