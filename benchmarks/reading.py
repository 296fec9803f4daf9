"""Reading a bag: a minute of poses, joints and wrenches of a robot, from MCAP to arrays.

Ours checks checksums, stamps and quaternions too; the peers decode each message into an object.
"""

import tempfile
from pathlib import Path

import numpy as np
from timing import Case, Contender

from dissertation.simulation.pick_and_place import session, write_takes
from structlearn.readers import read_recording
from structlearn.readers.source import TopicMap

REPEATS = 3
TOPICS = {"pose": "/gripper/pose", "joint_states": ("/joint_states",), "wrench": "/wrist/wrench"}


def reading() -> Case:
    """Positions of the hand are compared."""
    folder = Path(tempfile.mkdtemp())
    write_takes([session(1, 5, REPEATS)], folder)
    (path,) = folder.glob("*.mcap")
    others = dict.fromkeys(("twist", "tool_to_board", "joints"))
    topics = TopicMap(**TOPICS, tactile=(), **others)

    def ours() -> np.ndarray:
        return read_recording(path, topics).streams[0].values[:, :3]

    expected = ours()

    def error(found: np.ndarray) -> float:
        return float(np.abs(found - expected).max())

    return Case(
        work=f"reading a bag of {path.stat().st_size / 1e6:.1f} MB, three topics",
        ours=Contender(ours, error),
        peers={
            "mcap-ros2-support": lambda: Contender(_by_mcap(path), error),
            "rosbags": lambda: Contender(_by_rosbags(path), error),
        },
        tolerance=1e-12,
        note="ours checks checksums, stamps and quaternions too",
    )


def _wanted() -> list[str]:
    return [TOPICS["pose"], *TOPICS["joint_states"], TOPICS["wrench"]]


def _by_mcap(path: Path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    def run() -> np.ndarray:
        found = []
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages(topics=_wanted()):
                if channel.topic == TOPICS["pose"]:
                    place = message.pose.position
                    found.append((place.x, place.y, place.z))
        return np.array(found)

    return run


def _by_rosbags(path: Path):
    from rosbags.highlevel import AnyReader

    def run() -> np.ndarray:
        found = []
        with AnyReader([path]) as reader:
            wanted = [one for one in reader.connections if one.topic in _wanted()]
            for connection, _, raw in reader.messages(connections=wanted):
                message = reader.deserialize(raw, connection.msgtype)
                if connection.topic == TOPICS["pose"]:
                    place = message.pose.position
                    found.append((place.x, place.y, place.z))
        return np.array(found)

    return run


CASES = (reading,)
