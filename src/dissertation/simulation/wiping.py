"""Simulated wiping, as a lab might have recorded it: reach to a table, 3 to 5 strokes to and fro, retreat.

The number of strokes, their pace and length, and the wiped place vary between demonstrations; within one, the
rhythm is steady but for a few per cent. A stroke starts or stops at rest as a minimum-jerk move does; between
two strokes the hand turns back like a sine. Devices are those of `pick_and_place`.

The tool has a soft pad, through which the wrist feels the table. If the table is tilted, a person corrects
the wiping by `TAKEN_OVER` of the height by which the surface differs; what is left is felt.
"""

import sys
from pathlib import Path

import numpy as np

from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.pick_and_place import (
    BRISK,
    DOWN,
    GRID_HZ,
    OPEN_M,
    PAUSE_S,
    REST_S,
    RISE,
    SCATTER_M,
    Take,
    write_takes,
)
from structlearn.core import quaternion
from structlearn.core.artefacts import publish
from structlearn.core.frames import UP
from structlearn.core.signals import minimum_jerk
from structlearn.core.stage import run

NAMES = ("reach", "wipe", "retreat")
HOME = np.array([0.36, 0.00, 0.36])  # m
EDGE = np.array([0.52, -0.11, 0.14])  # m, where the first stroke starts
STROKE = np.array([0.02, 0.22, 0.0])  # m
BOW = np.array([0.015, 0.0, 0.0])  # m, of the middle of a stroke towards the edge, on the way to and fro
TURN_DEG = 10.0  # of the tool about the vertical along a stroke
PLACE_M, TURNING_M = 0.005, 0.001  # std per axis: of the wiped place, and of each turning point
LENGTH_SPREAD, TEMPO_SPREAD, RHYTHM_SPREAD = 0.05, 0.08, 0.02  # std of logarithms; the last of each stroke
STROKE_S, FEWEST, MOST = 0.9, 3, 5
PRESSED_M, PAD_N_PER_M, FRICTION = 0.006, 1000.0, 0.4  # of the pad
SLIDING_M_S = 0.02  # speed from which friction has its full size
TAKEN_OVER, NOTICED_S = 0.7, 0.4  # of the surface's height, by a person's correction; until it is all there
TILTS_DEG = (-6, -4, 4, 6)  # of the example's corrections
EXECUTED = 0.05  # of the spread between demonstrations, between executions of what was learned
TURNING_BACK = 0.5 * np.pi**2  # acceleration of a half sine at its ends, in stroke lengths and durations


def takes(seed: int, count: int = 6, pause_s: tuple[float, float] = (0.0, 0.0)) -> list[Take]:
    """Demonstrations of one person; `pause_s`: range of pauses between strokes."""
    return [
        _take(f"{number:02d}", seed, pause_s, source)
        for number, source in enumerate(np.random.SeedSequence([seed, MOST]).spawn(count), 1)
    ]


def executions(seed: int, tilt_deg: float, edge: np.ndarray = EDGE, count: int = 6) -> list[Take]:
    """Executions of the wiping from an `edge` (3,) m, corrected where the table is tilted."""
    drawn = np.random.SeedSequence([seed, MOST, 1 + round(100.0 * (90.0 + tilt_deg))]).spawn(count)
    return [
        _take(f"{number:02d}", seed, (0.0, 0.0), source, edge, tilt_deg, EXECUTED)
        for number, source in enumerate(drawn, 1)
    ]


def height(position: np.ndarray, edge: np.ndarray, tilt_deg: float) -> np.ndarray:
    """Height (...) m of a table over the level one, tilted half-way along the strokes, at (..., 3) m."""
    return np.tan(np.radians(tilt_deg)) * (position - edge - 0.5 * STROKE)[..., 1]


def contact_force(
    position: np.ndarray, velocity: np.ndarray, edge: np.ndarray, tilt_deg: float = 0.0
) -> np.ndarray:
    """Force (..., 3) N of the table on the tool, upwards and against its sliding; (..., 3) m, m/s."""
    pressed = edge[2] + PRESSED_M + height(position, edge, tilt_deg) - position[..., 2]
    up = PAD_N_PER_M * np.maximum(pressed, 0.0)[..., None]
    sliding = velocity * [1.0, 1.0, 0.0]
    speed = np.linalg.norm(sliding, axis=-1, keepdims=True)
    return up * (UP - FRICTION * sliding / np.sqrt(speed**2 + SLIDING_M_S**2))


def _take(
    name: str,
    seed: int,
    pause_s: tuple[float, float],
    source: np.random.SeedSequence,
    place: np.ndarray = EDGE,
    tilt_deg: float = 0.0,
    spread: float = 1.0,
) -> Take:
    drawn, hand, capture, arm = source.spawn(4)
    rng = np.random.default_rng(drawn)
    number = FEWEST + (int(name) - 1) % (MOST - FEWEST + 1)
    tempo, longer = np.exp(spread * np.array([TEMPO_SPREAD, LENGTH_SPREAD]) * rng.standard_normal(2))
    home = HOME + SCATTER_M["home"] * rng.standard_normal((2, 3))
    edge = place + spread * PLACE_M * rng.standard_normal(3)
    sides = np.arange(number + 1) % 2
    turning = spread * TURNING_M * rng.standard_normal((number + 1, 3))
    turns = edge + longer * sides[:, None] * STROKE + turning
    points = np.vstack([home[:1], turns, home[1:]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    seconds = (BRISK.seconds + BRISK.seconds_per_m * lengths) * tempo
    seconds[1:-1] = STROKE_S * tempo * np.exp(spread * RHYTHM_SPREAD * rng.standard_normal(number))
    rests = rng.uniform(*pause_s, number + 2) if pause_s[1] else np.zeros(number + 2)
    rests[[0, 1, -1]] = rng.uniform(*REST_S), *rng.uniform(*PAUSE_S, 2)
    starts = np.cumsum(rests) + np.append(0.0, np.cumsum(seconds[:-1]))
    end = starts[-1] + seconds[-1] + rng.uniform(*REST_S)
    time = np.arange(int(end * GRID_HZ)) / GRID_HZ

    flows = np.zeros(number + 3, dtype=bool)  # whether the hand turns back without a rest before a move
    flows[2:-2] = not pause_s[1]
    position, yaw = np.tile(points[0], (len(time), 1)), np.zeros(len(time))
    for move, (start, duration) in enumerate(zip(starts, seconds, strict=True)):
        s = np.clip((time - start) / duration, 0.0, 1.0)
        done = minimum_jerk(s)
        done = done + 0.5 * TURNING_BACK * s**2 * (1.0 - s) ** 2 * (
            flows[move] * (1.0 - s) - flows[move + 1] * s
        )
        strokes = 0 < move < len(starts) - 1
        way = points[move + 1] - points[move]
        along = way / lengths[move]
        bow = BOW if strokes else RISE * lengths[move] * (UP - (UP @ along) * along)
        position = position + done[:, None] * way
        position = position + 16 * ((done * (1 - done)) ** 2)[:, None] * bow
        yaw = yaw + strokes * done * np.radians(TURN_DEG) * (1 - 2 * sides[move - 1])
    back = np.clip((time - starts[-1]) / seconds[-1], 0.0, 1.0)
    yaw = yaw - yaw[-1] * minimum_jerk(back)  # after an odd number of strokes the tool is turned
    guided = minimum_jerk(np.clip((time - starts[1]) / NOTICED_S, 0.0, 1.0)) * (1.0 - minimum_jerk(back))
    position[:, 2] += TAKEN_OVER * guided * height(position, edge, tilt_deg)
    velocity = np.gradient(position, 1 / GRID_HZ, axis=0)
    shaken, turned = hand_noise(
        velocity, np.zeros(len(time)), BRISK.sway_mm, GRID_HZ, np.random.default_rng(hand)
    )
    turned[:, 2] += yaw
    position = position + shaken
    ends = starts + seconds
    segments = np.array([(starts[0], ends[0]), (starts[1], ends[-2]), (starts[-1], ends[-1])])
    return Take(
        name,
        NAMES,
        time,
        position,
        quaternion.product(quaternion.from_rotation_vector(turned), DOWN),
        np.full(len(time), OPEN_M),
        np.zeros(len(time), dtype=bool),
        np.zeros(len(time)),
        contact_force(position, velocity, edge, tilt_deg),
        segments,
        segments,
        seed,
        capture,
        arm,
    )


def main() -> None:
    """Write the bags of the wiping example to the two folders named by the command line.

    The first has the demonstrations, the second executions in `executions` and `corrections/TILT`.
    """
    demonstrated = takes(seed=1)
    starts = [np.searchsorted(take.time, take.segments[1, 0]) for take in demonstrated]
    edge = np.mean([take.position[start] for take, start in zip(demonstrated, starts, strict=True)], axis=0)
    sets = {"executions": executions(2, 0.0, edge)}
    sets |= {f"corrections/{tilt}": executions(2, tilt, edge) for tilt in TILTS_DEG}
    shown, executed = map(Path, sys.argv[1:])
    with publish(shown) as first, publish(executed) as second:
        first.mkdir()
        write_takes(demonstrated, first)
        for name, made in sets.items():
            (second / name).mkdir(parents=True)
            write_takes(made, second / name)
    print(f"{shown}: 6 bags; {executed}: {sum(map(len, sets.values()))} bags")


if __name__ == "__main__":
    run(main, stage=False)
