"""Simulated pick-and-place recordings, as a lab might have made them: an arm is guided from a part to a tray.

A person guiding a Franka Panda makes each demonstration, a few moves in space with pauses in between;
durations, starts, goals and paths vary. Motion capture records the gripper pose, the arm its joints, the
gripper its fingers, the wrist the force on it, each on its own clock.

Difficulties are added on request: a twitch that belongs to no move, a hesitation within a move, a missing
move. `make own-example` writes six bags without.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import structlearn
from dissertation.simulation.hand_noise import hand_noise
from structlearn.core import quaternion
from structlearn.core.artefacts import publish
from structlearn.core.frames import UP
from structlearn.core.signals import minimum_jerk
from structlearn.core.stage import run
from structlearn.readers.bag_recording import to_metadata
from structlearn.readers.demonstration import Kind, Recording, Stream
from structlearn.readers.messages import joint_messages, to_messages
from structlearn.readers.raw_messages import RawMessages, write_bag
from structlearn.readers.urdf_file import urdf_path

# Fingertip positions in the arm's base frame, m, and their scatter (std per axis)
HOME = np.array([0.40, 0.00, 0.45])
PART = np.array([0.50, -0.22, 0.13])
TRAY = np.array([0.45, 0.25, 0.14])
ABOVE = np.array([0.0, 0.0, 0.18])
PLACES = {"home": HOME, "part": PART, "tray": TRAY, "above part": PART + ABOVE, "above tray": TRAY + ABOVE}
SCATTER_M = {"home": 0.015, "part": 0.006, "tray": 0.006, "above part": 0.012, "above tray": 0.012}
YAW_DEG = {"home": 0.0, "part": 25.0, "tray": -20.0, "above part": 25.0, "above tray": -20.0}
YAW_SCATTER_DEG = 3.0
DOWN = np.array([0.0, 1.0, 0.0, 0.0])  # fingers pointing down

# Moves of the task, by their number, and the end of each; the first starts at home
MOVES = {
    2: {"reach": "part", "retreat": "home"},
    3: {"reach": "part", "carry": "tray", "retreat": "home"},
    5: {"reach": "part", "lift": "above part", "carry": "above tray", "lower": "tray", "retreat": "home"},
}

GRASP = {2: (1, 1), 3: (1, 2), 5: (1, 4)}  # number of moves after which the gripper closes and opens


@dataclass(frozen=True)
class GuidingHand:
    """How a person guides the arm: a move of d metres takes about `seconds + seconds_per_m * d`."""

    seconds: float
    seconds_per_m: float
    tempo_spread: float  # std of the duration's logarithm, shared by all moves of a demonstration
    move_spread: float  # likewise, for each move separately
    sway_mm: float  # std per axis


# At this pace the arm keeps its limits throughout the workspace (`structlearn check pick`)
BRISK = GuidingHand(1.0, 2.0, 0.08, 0.08, 0.3)
SLOW = GuidingHand(2.0, 4.0, 0.04, 0.04, 1.0)

# Pace
SKEW, WAVES = 0.5, 0.15  # std of the pace's exponents: early or late, alternately faster and slower
PAUSE_S, REST_S = (0.3, 1.0), (0.5, 1.2)  # between moves; before the first and after the last
HESITATION_S, HESITATION_DEPTH = (0.05, 0.10), (0.85, 1.0)  # std of a dip in the pace, and its depth
TWITCH_M, TWITCH_S = (0.006, 0.02), (0.25, 0.45)  # there and back
ONSET_SPEED = 0.05  # a move is visible while its speed is above this fraction of its peak

# Space: paths curve upwards and slightly sideways, as a fraction of their length
RISE, BOW_SPREAD = 0.15, 0.05

# Devices
GRID_HZ = 600.0
POSE_EVERY, JOINTS_EVERY, GRIPPER_EVERY = 5, 6, 20  # 120, 100 and 30 Hz
CAPTURE_MM, CAPTURE_DEG = (0.2, 0.5), 0.1  # motion capture noise, std per axis
JITTER_S = 0.001
OPEN_M, CLOSED_M, GRIPPER_S = 0.04, 0.015, 0.2  # per finger; duration of opening and closing
PART_KG, FORCE_N = 0.6, 0.15  # carried mass; std of the wrist's reading per axis
EPOCH_NS, BETWEEN_NS = 1_609_459_200_000_000_000, 60_000_000_000

URDF, TIP = "franka_panda/panda.urdf", "panda_grasptarget"
ELBOW_RAD = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8, 0.0, 0.0])  # initial guess for joint angles


@dataclass(frozen=True)
class Take:
    """One demonstration before recording, on T points of a grid at `GRID_HZ`."""

    name: str  # "01", "02", ...
    moves: tuple[str, ...]  # names of the moves made
    time: np.ndarray  # (T,) s
    position: np.ndarray  # (T, 3) m of the fingertips
    orientation: np.ndarray  # (T, 4) w, x, y, z
    opening: np.ndarray  # (T,) m of each finger
    grasps: np.ndarray  # (T,) whether the gripper is told to close
    load: np.ndarray  # (T,) kg carried
    contact: np.ndarray  # (T, 3) N of a surface on the tool, in the axes of the base
    segments: np.ndarray  # (P, 2) s, visible start and end of each move (`ONSET_SPEED`)
    planned: np.ndarray  # (P, 2) s, planned start and end, which are too slow to be visible
    seed: int  # of the set
    capture: np.random.SeedSequence  # for motion capture noise
    arm: np.random.SeedSequence  # for the noise of the other devices


def takes(
    seed: int,
    moves: int,
    count: int = 6,
    *,
    twitch: bool = False,
    hesitation: bool = False,
    without: Mapping[str, str] | None = None,
    hand: GuidingHand = BRISK,
) -> list[Take]:
    """Demonstrations of one person with 2, 3 or 5 moves (`MOVES`).

    `twitch`: each has one twitch in a rest or pause; `hesitation`: in each, one of the moves nearly stops on
    its way; `without`: move left out by demonstration, e.g. `{"04": "carry"}`.
    """
    found, skipped = [], without or {}
    for number, source in enumerate(np.random.SeedSequence([seed, moves]).spawn(count), 1):
        name = f"{number:02d}"
        goals = [(move, goal) for move, goal in MOVES[moves].items() if move != skipped.get(name)]
        found.append(_take(name, seed, goals, [GRASP[moves]], twitch, hesitation, hand, source))
    return found


def session(
    seed: int, moves: int, repeats: int, name: str = "01", *, twitch: bool = False, hesitation: bool = False
) -> Take:
    """Several repeats in one recording, with pauses in between. Arguments as in `takes`."""
    source = np.random.SeedSequence([seed, moves, repeats])
    closes, opens = GRASP[moves]
    grasps = [(closes + done, opens + done) for done in range(0, moves * repeats, moves)]
    return _take(name, seed, list(MOVES[moves].items()) * repeats, grasps, twitch, hesitation, BRISK, source)


def as_recording(take: Take) -> Recording:
    """Recording by motion capture alone; true segments are the planned ones, counted from the first pose."""
    captured = _captured(take)
    late_s = 1e-9 * float(captured.stamps[0] - _start_ns(take))
    provenance = {
        "origin": "simulated",
        "generator": __name__,
        "version": structlearn.__version__,
        "seed": str(take.seed),
        "what": f"an arm is led: {', '.join(take.moves)}",
    }
    return Recording(take.name, (captured,), take.planned - late_s, provenance)


def write_takes(made: Sequence[Take], folder: Path) -> None:
    """Write one bag per take: `/gripper/{pose,joint_states,grasp}`, `/joint_states`, `/wrist/wrench`."""
    for take in made:
        write_bag(folder / f"{take.name}.mcap", to_metadata(as_recording(take)), _topics(take).items())


@dataclass(frozen=True)
class _Move:
    """Timing and progress of one move."""

    start: float  # s
    grid: np.ndarray  # (N,) s since the start
    progress: np.ndarray  # (N,) 0 -> 1

    @property
    def end(self) -> float:
        return self.start + float(self.grid[-1])

    @property
    def seen(self) -> tuple[float, float]:
        speed = np.gradient(self.progress, self.grid)
        moving = self.grid[speed >= ONSET_SPEED * speed.max()]
        return self.start + float(moving[0]), self.start + float(moving[-1])

    def at(self, time: np.ndarray) -> np.ndarray:
        """Progress (T, 1) at times in s."""
        return np.interp(time - self.start, self.grid, self.progress)[:, None]


def _take(
    name: str,
    seed: int,
    goals: Sequence[tuple[str, str]],
    grasps: Sequence[tuple[int, int]],
    twitch: bool,
    hesitation: bool,
    led_by: GuidingHand,
    source: np.random.SeedSequence,
) -> Take:
    drawn, hand, capture, arm = source.spawn(4)
    rng = np.random.default_rng(drawn)
    stops = ["home", *(goal for _, goal in goals)]
    points = np.array([PLACES[stop] + SCATTER_M[stop] * rng.standard_normal(3) for stop in stops])
    yaws = np.radians([YAW_DEG[stop] + YAW_SCATTER_DEG * rng.standard_normal() for stop in stops])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    tempo = led_by.tempo_spread * rng.standard_normal()
    rests = [rng.uniform(*REST_S), *rng.uniform(*PAUSE_S, len(goals) - 1), rng.uniform(*REST_S)]
    twitches, again = rng.integers(len(rests)), rng.uniform(*PAUSE_S)
    lasts, far, way = rng.uniform(*TWITCH_S), rng.uniform(*TWITCH_M), rng.standard_normal(3)
    hesitates = rng.integers(len(goals)) if hesitation else None

    now, made, twitched = 0.0, [], 0.0
    for place, rest in enumerate(rests):
        now += rest
        if twitch and place == twitches:
            twitched = now
            now += lasts + again
        if place < len(goals):
            longer = np.exp(tempo + led_by.move_spread * rng.standard_normal())
            duration = (led_by.seconds + led_by.seconds_per_m * lengths[place]) * longer
            made.append(_move(now, duration, place == hesitates, rng))
            now = made[-1].end
    time = np.arange(int(now * GRID_HZ)) / GRID_HZ

    position = np.tile(points[0], (len(time), 1))
    yaw = np.full(len(time), yaws[0])
    for move, start, end, turn in zip(made, points, points[1:], np.diff(yaws), strict=False):
        done = move.at(time)
        position = position + done * (end - start) + 16 * (done * (1 - done)) ** 2 * _bow(end - start, rng)
        yaw = yaw + done[:, 0] * turn
    if twitch:
        there = np.clip((time - twitched) / lasts, 0.0, 1.0)[:, None]
        position = position + 16 * (there * (1 - there)) ** 2 * far * way / np.linalg.norm(way)
    velocity = np.gradient(position, 1 / GRID_HZ, axis=0)
    shaken, turned = hand_noise(
        velocity, np.zeros(len(time)), led_by.sway_mm, GRID_HZ, np.random.default_rng(hand)
    )
    turned[:, 2] += yaw
    held, told = np.zeros(len(time)), np.zeros(len(time), dtype=bool)
    for closes, opens in grasps:
        closing, opening = (made[min(moves, len(made)) - 1].end for moves in (closes, opens))
        closed = np.interp(time, closing + np.array([0.05, 0.05 + GRIPPER_S]), [0, 1])
        opened = np.interp(time, opening + np.array([0.0, GRIPPER_S]) + 0.3 * (closes == opens), [0, 1])
        held += closed * (1 - opened)
        told |= (closed > 0.0) & (opened == 0.0)
    return Take(
        name,
        tuple(move for move, _ in goals),
        time,
        position + shaken,
        quaternion.product(quaternion.from_rotation_vector(turned), DOWN),
        OPEN_M + held * (CLOSED_M - OPEN_M),
        told,
        PART_KG * (held > 0.9) * (closes < opens),
        np.zeros((len(time), 3)),
        np.array([move.seen for move in made]),
        np.array([(move.start, move.end) for move in made]),
        seed,
        capture,
        arm,
    )


def _move(start: float, duration: float, hesitates: bool, rng: np.random.Generator) -> _Move:
    """Minimum-jerk move with an uneven pace that varies between moves."""
    skew, waves = np.array([SKEW, WAVES]) * rng.standard_normal(2)
    angle = rng.uniform(0, 2 * np.pi)
    centre, width, depth = rng.uniform(0.35, 0.65), rng.uniform(*HESITATION_S), rng.uniform(*HESITATION_DEPTH)
    duration += hesitates * depth * width * np.sqrt(2 * np.pi)  # the rest of the move keeps its pace
    grid = np.linspace(0.0, duration, int(duration * GRID_HZ) + 2)
    s = grid / duration
    pace = np.exp(skew * (s - 0.5) + waves * np.cos(4 * np.pi * s + angle))
    pace = pace * (1 - hesitates * depth * np.exp(-0.5 * ((s - centre) * duration / width) ** 2))
    phase = np.append(0.0, np.cumsum(0.5 * (pace[1:] + pace[:-1])))
    return _Move(start, grid, minimum_jerk(phase / phase[-1]))


def _bow(way: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Offset (3,) m of a path's middle from the straight line, perpendicular to it."""
    off = RISE * UP + BOW_SPREAD * rng.standard_normal(3)
    along = way / np.linalg.norm(way)
    return np.linalg.norm(way) * (off - (off @ along) * along)


def _captured(take: Take) -> Stream:
    """Motion capture measurements."""
    rng = np.random.default_rng(take.capture)
    seen = slice(None, None, POSE_EVERY)
    position, orientation = take.position[seen], take.orientation[seen]
    noise_m = 1e-3 * rng.uniform(*CAPTURE_MM)
    turns = np.radians(CAPTURE_DEG) * rng.standard_normal(position.shape)
    orientation = quaternion.product(quaternion.from_rotation_vector(turns), orientation)
    values = np.hstack([position + noise_m * rng.standard_normal(position.shape), orientation])
    return Stream("/gripper/pose", "pose", _stamps(take, POSE_EVERY, rng), values)


def _topics(take: Take) -> dict[str, RawMessages]:
    capture = _captured(take)
    rng = np.random.default_rng(take.arm)
    stamps, fingers = _stamps(take, JOINTS_EVERY, rng), _stamps(take, GRIPPER_EVERY, rng)
    names, angles = joint_angles(take.position[::JOINTS_EVERY], take.orientation[::JOINTS_EVERY])
    velocities = np.gradient(angles, JOINTS_EVERY / GRID_HZ, axis=0)
    opening = np.repeat(take.opening[::GRIPPER_EVERY, None], 2, axis=1)
    force = np.outer(-9.81 * take.load[::JOINTS_EVERY], [0.0, 0.0, 1.0]) + take.contact[::JOINTS_EVERY]
    noise = FORCE_N * rng.standard_normal((len(force), 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    wrench = Stream("/wrist/wrench", "wrench", stamps, np.hstack([force, np.zeros_like(force)]) + noise)
    arm: dict[Kind, np.ndarray] = {"joint_positions": angles, "joint_velocities": velocities}
    hand = ["panda_finger_joint1", "panda_finger_joint2"]
    told = Stream("/gripper/grasp", "digital", fingers, take.grasps[::GRIPPER_EVERY, None].astype(float))
    return {
        capture.topic: to_messages(take.name, capture),
        "/joint_states": joint_messages(take.name, names, stamps, arm),
        "/gripper/joint_states": joint_messages(take.name, hand, fingers, {"joint_positions": opening}),
        told.topic: to_messages(take.name, told),
        wrench.topic: to_messages(take.name, wrench),
    }


def _stamps(take: Take, every: int, rng: np.random.Generator) -> np.ndarray:
    """Time stamps (N,) ns of a device with its own clock that samples every `every`-th grid point."""
    time = take.time[::every]
    bound = 0.4 * every / GRID_HZ  # keeps the stamps in order
    jitter = np.clip(JITTER_S * rng.standard_normal(len(time)), -bound, bound)
    jitter[0] = abs(jitter[0])
    return _start_ns(take) + np.round(1e9 * (time + jitter)).astype(np.int64)


def _start_ns(take: Take) -> int:
    return EPOCH_NS + (int(take.name) - 1) * BETWEEN_NS


def joint_angles(position: np.ndarray, orientation: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Names of the arm's joints, and joint angles (N, 7) in rad for fingertip poses.

    Each solution starts from the previous one, so that angles do not jump.
    """
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(urdf_path(URDF)))
    data, tip, arm = model.createData(), model.getFrameId(TIP), slice(0, 7)
    angles, found = ELBOW_RAD.copy(), []
    for place, turn in zip(position, orientation, strict=True):
        wanted = pinocchio.SE3(quaternion.matrix(turn), place)
        for _ in range(100):
            pinocchio.framesForwardKinematics(model, data, angles)
            error = pinocchio.log6(data.oMf[tip].actInv(wanted)).vector
            if np.linalg.norm(error) < 1e-7:  # m and rad
                break
            jacobian = pinocchio.computeFrameJacobian(model, data, angles, tip)[:, arm]
            damped = jacobian @ jacobian.T + 1e-6 * np.eye(6)
            angles[arm] += jacobian.T @ np.linalg.solve(damped, error)
        found.append(angles[arm].copy())
    return list(model.names[1:8]), np.array(found)


def main() -> None:
    """Write the bags of the example task to the folder named by the command line."""
    target = Path(sys.argv[1])
    with publish(target) as folder:
        folder.mkdir()
        write_takes(takes(seed=1, moves=3, count=6), folder)
    print(f"{target}: 6 bags")


if __name__ == "__main__":
    run(main, stage=False)
