"""Bags as a lab records them: an arm that is led at 1 kHz for a minute, with what its devices report.

    python benchmarks/made_up_bags.py FOLDER COUNT [SECONDS]

Topics are `/gripper/pose`, `/joint_states` (seven joints: position, velocity, effort) and `/wrist/wrench`.
The hand moves as in `pick_and_place`, stretched to the duration; joint angles are smooth functions of its
place, since no robot has to follow them. A bag of 60 s has 180 000 messages and 20 MB, 36 MB unpacked.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dissertation.simulation.pick_and_place import Take, takes
from structlearn.core import quaternion
from structlearn.readers.bag_recording import to_metadata
from structlearn.readers.demonstration import Kind, Recording, Stream
from structlearn.readers.messages import joint_messages, to_messages
from structlearn.readers.raw_messages import RawMessages, write_bag

TOPICS = {"pose": "/gripper/pose", "joint_states": ["/joint_states"], "wrench": "/wrist/wrench"}
JOINTS = [f"joint_{number}" for number in range(1, 8)]
RATE_HZ, SECONDS = 1000.0, 60.0
EPOCH_NS = 1_609_459_200_000_000_000
NOISE_M, NOISE_N = 2e-4, 0.15


def write_demonstrations(folder: Path, count: int, seconds: float = SECONDS) -> None:
    """Write so many bags, one per demonstration."""
    folder.mkdir(parents=True, exist_ok=True)
    for take in takes(seed=1, moves=5, count=count):
        provenance = {
            "origin": "simulated",
            "generator": "benchmarks/made_up_bags.py",
            "seed": str(take.seed),
        }
        about = Recording(take.name, (), take.planned * (seconds / take.time[-1]), provenance)
        write_bag(folder / f"{take.name}.mcap", to_metadata(about), topics(take, seconds).items())


def topics(take: Take, seconds: float = SECONDS) -> Mapping[str, RawMessages]:
    """Messages of a take, stretched to a duration."""
    rng = np.random.default_rng(take.arm)
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    stamps = EPOCH_NS + np.round(1e9 * time).astype(np.int64)
    at = time * (take.time[-1] / seconds)
    position = np.stack([np.interp(at, take.time, axis) for axis in take.position.T], axis=1)
    turned = quaternion.interpolate(at, take.time, take.orientation)
    position += NOISE_M * rng.standard_normal(position.shape)
    mix = rng.standard_normal((3, len(JOINTS)))
    angles = np.sin(position @ mix)
    velocities = np.gradient(angles, 1.0 / RATE_HZ, axis=0)
    efforts = 10.0 * angles + rng.standard_normal(angles.shape)
    wrench = NOISE_N * rng.standard_normal((len(time), 6))
    wrench[:, 2] -= 9.81 * np.interp(at, take.time, take.load)
    signals: dict[Kind, np.ndarray] = {
        "joint_positions": angles,
        "joint_velocities": velocities,
        "joint_torques": efforts,
    }
    pose = Stream(TOPICS["pose"], "pose", stamps, np.hstack([position, turned]))
    return {
        TOPICS["pose"]: to_messages(take.name, pose),
        "/joint_states": joint_messages(take.name, JOINTS, stamps, signals),
        TOPICS["wrench"]: to_messages(take.name, Stream("wrench", "wrench", stamps, wrench)),
    }


if __name__ == "__main__":
    write_demonstrations(Path(sys.argv[1]), int(sys.argv[2]), *map(float, sys.argv[3:]))
