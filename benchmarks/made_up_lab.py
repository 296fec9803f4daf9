"""Bags of a made-up lab: an arm is guided from a part to a tray, as by `simulation.pick_and_place`.

Moves, tempo and places vary between demonstrations. Each bag has the pose of the gripper, the arm's seven
joints with velocities and efforts, and the wrench at the wrist, all at one rate.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dissertation.simulation.pick_and_place import (
    ELBOW_RAD,
    FORCE_N,
    MOVES,
    URDF,
    GuidingHand,
    Take,
    as_recording,
    joint_angles,
    takes,
)
from structlearn.core import quaternion
from structlearn.core.parallel import parallel_map
from structlearn.readers.bag_recording import to_metadata
from structlearn.readers.demonstration import Kind, Recording, Stream
from structlearn.readers.messages import joint_messages, to_messages
from structlearn.readers.raw_messages import RawMessages, write_bag
from structlearn.readers.urdf_file import urdf_path

POSE, JOINTS, WRENCH = "/gripper/pose", "/joint_states", "/wrist/wrench"
TOPICS = {"pose": POSE, "joint_states": [JOINTS], "wrench": WRENCH}
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
PAUSES_S = 0.9  # mean pause or rest, of which there is one more than moves
CAPTURE_M, GRAVITY = 0.0003, 9.81  # m, std of the pose per axis
KNOT_S = 0.1  # s between the samples whose joint angles are solved for; closer ones differentiate tremor


def write_lab(folder: Path, count: int, seconds: float, rate_hz: float, moves: int = 5) -> None:
    """Write so many bags of about so many seconds, `001.mcap` and on; existing ones are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [number for number in range(1, count + 1) if not (folder / f"{number:03d}.mcap").exists()]
    write = partial(_write, folder=folder, seconds=seconds, rate_hz=rate_hz, moves=moves)
    parallel_map(write, missing, "bags")


def _write(number: int, folder: Path, seconds: float, rate_hz: float, moves: int) -> None:
    recording, topics = demonstration(number, seconds, rate_hz, moves)
    unfinished = folder / f".{number:03d}"
    write_bag(unfinished, to_metadata(recording), topics.items())
    unfinished.rename(folder / f"{number:03d}.mcap")


def demonstration(
    number: int, seconds: float, rate_hz: float, moves: int = 5
) -> tuple[Recording, dict[str, RawMessages]]:
    """What is known of a demonstration, which is drawn by its number, and its messages by topic."""
    hand = GuidingHand(seconds / moves - PAUSES_S * (moves + 1) / moves, 0.0, 0.05, 0.05, 0.3)
    (take,) = takes(number, moves, 1, hand=hand)
    name, rng = f"{number:03d}", np.random.default_rng(number)
    time = np.arange(0.0, take.time[-1], 1.0 / rate_hz)
    stamps = number * 10**12 + np.round(1e9 * time).astype(np.int64)
    position = _at(time, take, take.position) + CAPTURE_M * rng.standard_normal((len(time), 3))
    turn = quaternion.interpolate(time, take.time, quaternion.sign_continuous(take.orientation))
    names, joints = _joints(take, time)
    force = np.zeros((len(time), 6))
    force[:, 2] = -GRAVITY * _at(time, take, take.load[:, None])[:, 0]
    force += FORCE_N * rng.standard_normal(force.shape) * [1, 1, 1, 0.1, 0.1, 0.1]
    pose = Stream(POSE, "pose", stamps, np.hstack([position, turn]))
    return as_recording(take), {
        POSE: to_messages(name, pose),
        JOINTS: joint_messages(name, names, stamps, joints),
        WRENCH: to_messages(name, Stream(WRENCH, "wrench", stamps, force)),
    }


def _at(time: np.ndarray, take: Take, values: np.ndarray) -> np.ndarray:
    """Signals (N, D) of a take at other times (T,) s."""
    return np.stack([np.interp(time, take.time, column) for column in values.T], axis=1)


def _joints(take: Take, time: np.ndarray) -> tuple[list[str], dict[Kind, np.ndarray]]:
    """Names of the arm's joints; their angles, velocities and torques (T, 7)."""
    import pinocchio
    from scipy.interpolate import CubicSpline

    every = max(1, round(KNOT_S / take.time[1]))
    knots = take.time[::every]
    names, angles = joint_angles(take.position[::every], take.orientation[::every])
    path = CubicSpline(knots, angles)
    model = pinocchio.buildModelFromUrdf(str(urdf_path(URDF)))
    data, state = model.createData(), np.zeros((3, model.nq))
    state[0] = ELBOW_RAD
    torques = np.empty_like(angles)
    for place, knot in enumerate(knots):
        state[:, :7] = [path(knot, order) for order in range(3)]
        torques[place] = pinocchio.rnea(model, data, *state)[:7]
    return names, {
        "joint_positions": path(time),
        "joint_velocities": path(time, 1),
        "joint_torques": CubicSpline(knots, torques)(time),
    }


def entry(bags: Path, moves: int, **others: Any) -> dict[str, Any]:
    """Entry of a task on such bags."""
    return {"source": str(bags), "topics": TOPICS, "segment": {"primitives": list(MOVES[moves])}, **others}
