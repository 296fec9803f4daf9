"""Recordings of eleven kinds, as labs make them: is the proposal of `inspect` right, and where does it cut?

    python benchmarks/kinds_of_recordings.py [--seeds 1 2 3] [--only WORD] [--keep FOLDER]

For each kind and seed, bags are written, an entry is proposed, the recordings are imported and cut with it
as by the stages of a task, and the cuts are compared with the moves that were made. A proposal is right if it
has as many primitives as moves, in their order, and those that only turn have `axis: rot` or lie `between`;
strokes whose number varies are one primitive with `axis: strokes`.

A hand makes minimum-jerk moves of uneven pace, with rests between; starts, goals, paths, durations and rests
differ between demonstrations. It sways by 0.3 mm, and motion capture adds noise of its own.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mcap_ros2.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_typestore

from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.pick_and_place import DOWN, URDF, joint_angles
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.readers.bag_recording import to_metadata
from structlearn.readers.demonstration import Demonstration, Kind, Recording, Stream, read_runs
from structlearn.readers.messages import joint_messages, to_messages
from structlearn.readers.raw_messages import RawMessages, write_bag
from structlearn.readers.urdf_file import urdf_path
from structlearn.segmentation.segments import Segmentation
from structlearn.tasks.inspection.recordings_report import as_yaml, find_out
from structlearn.tasks.movement import recordings
from structlearn.tasks.movement.lerobot_export import write_lerobot
from structlearn.tasks.movement.movement_learning import segmented
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_entry import read_task

RATE_HZ = 100.0
EPOCH_NS = 1_609_459_200_000_000_000
SWAY_MM, CAPTURE_M, CAPTURE_DEG = 0.3, 2e-4, 0.1  # std per axis
SCATTER_M, SCATTER_DEG = 0.008, 3.0  # of goals, std per axis
TEMPO, PACE = 0.08, 0.4  # std of the logarithm of durations, and of the unevenness of the pace
REST_S, PAUSE_S = (0.6, 1.2), (0.4, 0.9)
JITTER_S, DROPPED = 0.002, 0.05  # of a busy network


@dataclass(frozen=True)
class Move:
    """One move: its goal, and how it gets there."""

    to: tuple[float, float, float]  # m
    turn_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)  # at the goal, rotation vector from hanging down
    seconds: float = 1.2
    pauses: bool = True  # whether the hand rests afterwards
    turns: bool = False  # in place


HOME = (0.40, 0.0, 0.40)
CUP = (0.52, -0.18, 0.25)
TRAY = (0.45, 0.22, 0.16)
TILTED = (105.0, 0.0, 0.0)

POUR = [
    Move(CUP),
    Move(CUP, TILTED, 1.5, turns=True),
    Move(CUP, seconds=1.3, turns=True),
    Move(HOME),
]
POUR_ALONG = [
    Move(CUP),
    Move((0.50, -0.10, 0.29), TILTED, 1.6),
    Move(CUP, seconds=1.4),
    Move(HOME),
]
PICK = [Move((0.50, -0.22, 0.13)), Move(TRAY), Move(HOME)]
LEFT, RIGHT = (0.50, -0.12, 0.12), (0.50, 0.12, 0.12)


def wipe(strokes: int, pauses: bool) -> list[Move]:
    """Approach, strokes to and fro, retreat."""
    ends = [(RIGHT, LEFT)[stroke % 2] for stroke in range(strokes)]
    to_and_fro = [Move(end, seconds=0.9, pauses=pauses) for end in ends[:-1]]
    return [Move(LEFT), *to_and_fro, Move(ends[-1], seconds=0.9), Move(HOME)]


@dataclass(frozen=True)
class Take:
    """One recording: poses on T ticks of a clock, and the moves made."""

    name: str
    time: np.ndarray  # (T,) s
    position: np.ndarray  # (T, 3) m
    orientation: np.ndarray  # (T, 4)
    segments: np.ndarray  # (P, 2) s


def take(name: str, moves: Sequence[Move], rng: np.random.Generator) -> Take:
    """A demonstration of some moves, from home."""
    now, tempo = rng.uniform(*REST_S), np.exp(TEMPO * rng.standard_normal())
    start, turned = np.array(HOME) + SCATTER_M * rng.standard_normal(3), np.zeros(3)
    plan = []
    for place, move in enumerate(moves):
        goal = np.array(move.to) + SCATTER_M * rng.standard_normal(3)
        goal = start if move.turns else goal
        turn = np.array(move.turn_deg) + SCATTER_DEG * rng.standard_normal(3) * (np.any(move.turn_deg))
        seconds = move.seconds * tempo * np.exp(TEMPO * rng.standard_normal())
        bow = 0.06 * np.linalg.norm(goal - start) * np.array([0.3 * rng.standard_normal(), 0.0, 1.0])
        plan.append(
            (now, seconds, goal - start, bow, np.radians(turn) - turned, PACE * rng.standard_normal())
        )
        start, turned = goal, np.radians(turn)
        last = place == len(moves) - 1
        now += seconds + (rng.uniform(*REST_S) if last else rng.uniform(*PAUSE_S) if move.pauses else 0.0)
    ticks = np.arange(round(now * RATE_HZ)) / RATE_HZ
    first = start - sum(step for _, _, step, *_ in plan)
    position, turns = np.tile(first, (len(ticks), 1)), np.zeros((len(ticks), 3))
    for begin, seconds, step, bow, turning, skew in plan:
        s = np.clip((ticks - begin) / seconds, 0.0, 1.0)
        done = minimum_jerk(s + skew * (s * (1.0 - s)) ** 2)[:, None]
        position += done * step + 4.0 * done * (1.0 - done) * bow
        turns += done * turning
    velocity = np.gradient(position, 1.0 / RATE_HZ, axis=0)
    moved, shaken = hand_noise(velocity + 1e-6, np.zeros(len(ticks)), SWAY_MM, RATE_HZ, rng)
    captured = CAPTURE_M * rng.standard_normal(position.shape)
    noise = shaken + np.radians(CAPTURE_DEG) * rng.standard_normal(position.shape)
    orientation = quaternion.product(
        quaternion.from_rotation_vector(noise), quaternion.from_rotation_vector(turns)
    )
    segments = np.array([(begin, begin + seconds) for begin, seconds, *_ in plan])
    return Take(name, ticks, position + moved + captured, quaternion.product(orientation, DOWN), segments)


Topics = Mapping[str, RawMessages]


def stamps_of(made: Take) -> np.ndarray:
    """(T,) int64 ns."""
    return EPOCH_NS + np.round(1e9 * made.time).astype(np.int64)


def poses(made: Take, rng: np.random.Generator, topic: str = "/tool/pose") -> Topics:
    """A topic of poses."""
    values = np.hstack([made.position, made.orientation])
    return {topic: to_messages(made.name, Stream(topic, "pose", stamps_of(made), values))}


def with_wrench(made: Take, rng: np.random.Generator) -> Topics:
    """Poses, and a wrist that carries less as it pours."""
    force = 0.15 * rng.standard_normal((len(made.time), 6))
    force[:, 2] -= np.interp(made.time, made.segments[1], [9.0, 5.0])
    wrench = Stream("/wrist/wrench", "wrench", stamps_of(made), force)
    return {**poses(made, rng), wrench.topic: to_messages(made.name, wrench)}


def of_joints(made: Take, rng: np.random.Generator) -> Topics:
    """Seven joints and a finger's on one topic, no pose."""
    names, angles = joint_angles(made.position, made.orientation)
    noisy = angles + 1e-4 * rng.standard_normal(angles.shape)
    state: dict[Kind, np.ndarray] = {"joint_positions": np.hstack([noisy, np.full((len(noisy), 1), 0.02)])}
    joints = [*names, "panda_finger_joint1"]
    return {"/joint_states": joint_messages(made.name, joints, stamps_of(made), state)}


def bimanual(made: Take, rng: np.random.Generator) -> Topics:
    """Two hands, of which the second helps a little."""
    position = made.position[:1] * [1, -1, 1] + 0.3 * (made.position - made.position[:1])
    other = Take(made.name, made.time, position, made.orientation, made.segments)
    return {**poses(made, rng, "/left/pose"), **poses(other, rng, "/right/pose")}


def write_transforms(path: Path, made: Take, rng: np.random.Generator) -> None:
    """Frames map -> odom -> base_link -> tool0 on /tf, with jitter and lost messages."""
    kind = "tf2_msgs/msg/TFMessage"
    jitter = np.clip(JITTER_S * rng.standard_normal(len(made.time)), -0.4 / RATE_HZ, 0.4 / RATE_HZ)
    stamps = stamps_of(made) + np.round(1e9 * jitter).astype(np.int64)
    rest = np.array([1.0, 0.0, 0.0, 0.0])
    with open(path, "wb") as file:
        writer = McapWriter(file)
        text, _ = get_typestore(Stores.LATEST).generate_msgdef(kind, ros_version=2)
        schema = writer.register_msgdef(kind, text)
        for stamp, position, turn, drift in zip(
            stamps.tolist(), made.position, made.orientation, 0.002 * made.time, strict=True
        ):
            links = [
                ("map", "odom", np.array([1.0, 2.0, 0.0]), rest),
                ("odom", "base_link", np.array([drift, 0.0, 0.0]), rest),
                ("base_link", "tool0", position, turn),
            ]
            transforms = [_transform(stamp, *link) for link in links if rng.uniform() > DROPPED]
            if transforms:
                writer.write_message("/tf", schema, {"transforms": transforms}, stamp, stamp)
        writer.finish()


def _transform(stamp: int, parent: str, child: str, position: np.ndarray, turn: np.ndarray) -> dict[str, Any]:
    header = {"stamp": dict(zip(("sec", "nanosec"), divmod(stamp, 10**9), strict=True)), "frame_id": parent}
    translation = dict(zip("xyz", position.tolist(), strict=True))
    rotation = dict(zip("wxyz", turn.tolist(), strict=True))
    transform = {"translation": translation, "rotation": rotation}
    return {"header": header, "child_frame_id": child, "transform": transform}


def write_dataset(folder: Path, made: Sequence[Take]) -> None:
    """A LeRobotDataset of poses, one episode per demonstration."""
    runs = [Demonstration(one.name, one.time, one.position, one.orientation) for one in made]
    rows = [(one.name, "all", "wls", 0.0, one.time[-1]) for one in made]
    cuts = pd.DataFrame(rows, columns=["demonstration", "primitive", "method", "start_s", "end_s"])
    none = pd.DataFrame()
    whole = Segmentation(cuts, none, none, none, made[0].name)
    write_lerobot(runs, whole, folder, "a task", 5.0)


@dataclass(frozen=True)
class RecordingKind:
    """Moves of a task, and how they are recorded."""

    moves: Sequence[Move]
    write: Callable[[Take, np.random.Generator], Topics] = poses
    count: int = 8
    repeats: int = 1  # in each recording
    urdf: str | None = None
    others: tuple[Sequence[Move], ...] = ()  # moves of further demonstrations, each in turn


KINDS = {
    "pour in place": RecordingKind(POUR),
    "pour along, wrench": RecordingKind(POUR_ALONG, with_wrench),
    "joints and gripper": RecordingKind(PICK, of_joints, count=5, urdf=URDF),
    "wipe, pauses": RecordingKind(wipe(4, True)),
    "wipe, no pauses": RecordingKind(wipe(4, False)),
    "wipe, 3 to 5 strokes": RecordingKind(wipe(4, True), others=(wipe(3, True), wipe(5, True))),
    "/tf, jitter, dropouts": RecordingKind(PICK),
    "bimanual": RecordingKind(PICK, bimanual),
    "LeRobot": RecordingKind(PICK),
    "session of 5": RecordingKind(PICK, count=1, repeats=5),
    "one": RecordingKind(PICK, count=1),
    "sixty": RecordingKind(PICK, count=60),
}


LETTERS = {"xyz": "T", "rot": "R", "strokes": "S"}
STROKES = ["xyz", "strokes", "xyz"]  # primitives of a kind whose number of strokes varies


def write_recordings(name: str, seed: int, folder: Path) -> list[Take]:
    """Write the recordings of a kind; return what was made, one take per recording."""
    kind, rng = KINDS[name], np.random.default_rng([seed, list(KINDS).index(name)])
    variants = [kind.moves, *kind.others]
    made = [
        take(f"{place + 1:02d}", [*variants[place % len(variants)]] * kind.repeats, rng)
        for place in range(kind.count)
    ]
    if name == "LeRobot":
        write_dataset(folder, made)
        return made
    folder.mkdir(parents=True)
    for one in made:
        if name.startswith("/tf"):
            write_transforms(folder / f"{one.name}.mcap", one, rng)
        else:
            about = to_metadata(Recording(one.name, (), one.segments, {"origin": "simulated"}))
            write_bag(folder / f"{one.name}.mcap", about, kind.write(one, rng).items())
    return made


@dataclass(frozen=True)
class Outcome:
    """What came out for one kind and seed."""

    right: bool
    proposed: str  # primitives of the entry, in words
    errors_ms: np.ndarray  # (N,) of the starts and ends of all moves; empty if they cannot be compared
    used: int  # demonstrations without a cut warning
    warnings: int
    seconds: float  # CPU


def outcome(name: str, seed: int, folder: Path) -> Outcome:
    """Write, inspect, import and cut the recordings of one kind.

    Files go to a `folder` of their own.
    """
    kind = KINDS[name]
    made = write_recordings(name, seed, folder / "bags")
    began = time.process_time()
    try:
        found = find_out(str(folder / "bags"), None if kind.urdf is None else str(urdf_path(kind.urdf)))
    except InputError as error:
        return Outcome(False, str(error).rpartition(": ")[2], np.zeros(0), 0, 0, time.process_time() - began)
    if found.proposal is None:
        return Outcome(False, "none", np.zeros(0), 0, 0, time.process_time() - began)
    entry = folder / "structlearn.yaml"
    entry.write_text("\n".join(["movement:", *as_yaml(found.proposal)]))
    task = read_task(found.proposal.name, entry)
    assert isinstance(task, MovementEntry)
    assert task.segment is not None
    axes = ["rot" if one.axis == "between" else one.axis for one in task.segment.primitives]
    words = f"{len(axes)} {' '.join(LETTERS[axis] for axis in axes)}"
    words += f" x {task.repeats}" if task.repeats != 1 else ""
    wanted = ["rot" if move.turns else "xyz" for move in kind.moves]
    right = axes == (STROKES if kind.others else wanted)
    right &= (task.repeats == "auto") == (kind.repeats > 1)
    try:
        (folder / "recorded").mkdir()
        recordings.write(task, folder / "recorded", {})
        cuts = segmented(read_runs(folder / "recorded/demonstrations.parquet"), None, task.segment)
    except InputError as error:
        return Outcome(right, f"{words}: {error}", np.zeros(0), 0, 0, time.process_time() - began)
    seconds = time.process_time() - began
    flagged = set(cuts.warnings["demonstration"])
    errors = [np.zeros(0)]
    runs = read_runs(folder / "recorded/demonstrations.parquet")
    for run in runs:
        true = _true(made, run, kind, folder / "recorded")
        ends = [rows.loc[run.name] for rows in cuts.results.values() if run.name in rows.index]
        if len(ends) == len(true) and run.name not in flagged:
            found_s = np.array([(row["start_s"], row["end_s"]) for row in ends])
            errors.append(1e3 * np.abs(found_s - true).ravel())
    used = len(set(cuts.cuts["demonstration"]) - flagged)
    return Outcome(right, words, np.concatenate(errors), used, len(cuts.warnings), seconds)


def _true(made: Sequence[Take], run: Demonstration, kind: RecordingKind, recorded: Path) -> np.ndarray:
    """(P, 2) s, moves of a demonstration."""
    names = [one.name for one in made]
    if kind.repeats == 1:
        of = [place for place, name in enumerate(names) if run.name.endswith(name)]
        if not of:
            return np.zeros((0, 2))
        first, *strokes, last = made[of[0]].segments
        varying = [first, (strokes[0][0], strokes[-1][1]), last]
        return np.array(varying) if kind.others else made[of[0]].segments
    if not (recorded / "repeats.parquet").exists():  # nobody proposed to split the session
        return np.zeros((0, 2))
    rows = pd.read_parquet(recorded / "repeats.parquet").set_index("demonstration").loc[run.name]
    segments = made[names.index(str(rows["recording"]))].segments
    inside = (segments[:, 0] > rows["start_s"]) & (segments[:, 1] < rows["end_s"] + 0.05)
    return segments[inside] - rows["start_s"]


def report(names: Iterable[str], seeds: Sequence[int], keep: Path | None) -> None:
    """Print a line per kind."""
    print(f"{'kind':24} right   used  warnings  cuts mean, max (ms)  CPU (s)  proposed")
    for name in names:
        outcomes = []
        for seed in seeds:
            with tempfile.TemporaryDirectory() as scratch:
                outcomes.append(
                    outcome(name, seed, (keep or Path(scratch)) / f"{name.replace('/', '')} {seed}")
                )
        errors = np.concatenate([one.errors_ms for one in outcomes])
        cuts = f"{errors.mean():8.1f} {errors.max():8.1f}" if len(errors) else f"{'-':>8} {'-':>8}"
        used, warned = (sum(getattr(one, key) for one in outcomes) for key in ("used", "warnings"))
        proposed = "; ".join(dict.fromkeys(one.proposed for one in outcomes))
        right = f"{sum(one.right for one in outcomes)}/{len(outcomes)}"
        seconds = max(one.seconds for one in outcomes)
        print(f"{name:24} {right:>5} {used:6} {warned:9} {cuts:>20} {seconds:8.1f}  {proposed}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--only", default="", help="kinds with this word")
    parser.add_argument("--keep", type=Path, help="folder to keep the recordings in")
    given = parser.parse_args()
    report([name for name in KINDS if given.only in name], given.seeds, given.keep)
