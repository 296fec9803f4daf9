"""Reading a bag: a minute of poses, joints and wrenches of a robot, from MCAP to arrays.

Ours checks checksums, stamps and quaternions too; the peers decode each message into an object.
"""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from made_up_lab import TOPICS, demonstration
from mcap.records import Schema
from mcap.well_known import SchemaEncoding
from timing import Case, Contender

from dissertation.simulation.pick_and_place import session, write_takes
from structlearn.readers import read_recording
from structlearn.readers.bag_recording import to_metadata
from structlearn.readers.messages import definition
from structlearn.readers.raw_messages import RawMessages, write_bag
from structlearn.readers.source import TopicMap

REPEATS = 3
SECONDS, RATE_HZ = 60.0, 1000.0
CAMERA_HZ, PICTURE_BYTES = 5.0, 3 * 640 * 480


def reading() -> Case:
    """Positions of the hand are compared."""
    write_takes([session(1, 5, REPEATS)], folder := _folder())
    return _case(folder / "01.mcap", "three topics")


def reading_large() -> Case:
    """A minute at 1 kHz (180 000 messages) beside a camera, which nobody asks for but everybody unpacks."""
    about, messages = demonstration(1, SECONDS, RATE_HZ)
    messages["/camera"] = _camera(messages[TOPICS["pose"]].log_times)
    write_bag(path := _folder() / "large.mcap", to_metadata(about), messages.items())
    return _case(path, "three topics of 1 kHz beside a camera")


def _case(path: Path, content: str) -> Case:
    others = dict.fromkeys(("twist", "tool_to_board", "joints"))
    wanted = TopicMap(**TOPICS, tactile=(), **others)

    def ours() -> np.ndarray:
        return read_recording(path, wanted).streams[0].values[:, :3]

    expected = ours()

    def error(found: np.ndarray) -> float:
        return float(np.abs(found - expected).max())

    return Case(
        work=f"reading a bag of {path.stat().st_size / 1e6:.1f} MB, {content}",
        ours=Contender(ours, error),
        peers={
            "mcap-ros2-support": lambda: Contender(_by_mcap(path), error),
            "rosbags": lambda: Contender(_by_rosbags(path), error),
        },
        tolerance=1e-12,
        note="ours checks checksums, stamps and quaternions too",
    )


@cache
def _temporary() -> tempfile.TemporaryDirectory:
    """Removed when the benchmark ends."""
    return tempfile.TemporaryDirectory()


def _folder() -> Path:
    return Path(_temporary().name)


def _camera(stamps: np.ndarray) -> RawMessages:
    """Pictures of 640 x 480 pixels at 5 Hz during a recording, of noise, which does not compress."""
    rng, name = np.random.default_rng(1), "std_msgs/msg/Float32MultiArray"
    schema = Schema(id=0, name=name, encoding=SchemaEncoding.ROS2, data=definition(name).encode())
    times = stamps[:: round(RATE_HZ / CAMERA_HZ)]
    return RawMessages(times, [schema] * len(times), [rng.bytes(PICTURE_BYTES) for _ in times])


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


CASES = (reading, reading_large)
