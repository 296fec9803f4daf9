"""Joint logs, and several publishers on one topic, told apart by the names of the joints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from readers_bags import joint_messages, make_recording, pose_messages, pose_rows, read_messages, write_bag

from structlearn.core.errors import InputError
from structlearn.readers import Recording, Stream, read_recording, synchronise, write_recording
from structlearn.readers.bag_recording import JOINT_STATES, read_joint_log, write_joint_log
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table, signals_of, write_log_table

JOINT_STATE = "sensor_msgs/msg/JointState"
NAMES = ["shoulder", "elbow"]
SIGNALS = signals_of(JointLog)
VALUES = np.array([[0.1, 0.2], [0.3, 0.4]])


def log(**changes) -> JointLog:
    values = np.arange(6.0).reshape(3, 2)
    fields = {
        "name": "run",
        "joints": tuple(NAMES),
        "stamps": np.array([5, 7, 11]) * 10**6,
        "positions": values,
        "velocities": values + 10.0,
        "torques": values / 3.0,
        "provenance": {"origin": "simulated", "seed": "1"},
    }
    return JointLog(**(fields | changes))


def bag(path, **changes):
    """Three messages of joint states; a field set to None is left out."""
    rows = []
    for row in range(3):
        stamp = {"sec": 4, "nanosec": row * 10**7}
        message = {"header": {"stamp": stamp, "frame_id": ""}, "name": NAMES}
        message |= {"position": [row, 1.0], "velocity": [2.0, row], "effort": [0.5, -row]}
        message = {key: value for key, value in (message | changes).items() if value is not None}
        rows.append((JOINT_STATES, JOINT_STATE, message, row * 10**7))
    write_bag(path, rows)
    return path


def test_logs_go_through_a_file_and_a_table_bit_by_bit(tmp_path):
    signals = dict.fromkeys(SIGNALS, VALUES)
    other = log(name="other", joints=("a", "b"), stamps=np.array([-1, 2**62]), **signals)
    drives = DriveLog("drives", ("a", "b"), np.array([1, 2]), *[VALUES + number for number in range(5)])
    for logs in ([log(), other], [drives]):
        write_log_table(logs, tmp_path / "logs.parquet")
        back = read_log_table(tmp_path / "logs.parquet", type(logs[0]))
        for one, read in zip(logs, back, strict=True):
            assert (read.name, read.joints, read.provenance) == (one.name, one.joints, one.provenance)
            for field in ("stamps", *signals_of(type(one))):
                np.testing.assert_array_equal(getattr(read, field), getattr(one, field))
    write_joint_log(log(), tmp_path / "run.mcap")
    back = read_joint_log(tmp_path / "run.mcap")
    assert (back.name, back.joints, back.provenance) == ("run", log().joints, log().provenance)
    for field in ("stamps", *SIGNALS):
        np.testing.assert_array_equal(getattr(back, field), getattr(log(), field))
    np.testing.assert_allclose(back.time, [0.0, 0.002, 0.006], atol=1e-15)
    with pytest.raises(InputError, match=r"logs.parquet: no JointLog: drives has no 'torques.a'"):
        read_log_table(tmp_path / "logs.parquet")


def test_a_robots_bag_is_read_without_our_metadata(tmp_path):
    back = read_joint_log(bag(tmp_path / "robot.mcap"))
    assert back.joints == tuple(NAMES)
    np.testing.assert_array_equal(back.torques, [[0.5, 0.0], [0.5, -1.0], [0.5, -2.0]])
    assert back.provenance == {"origin": "recorded", "source": "robot.mcap"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"effort": None}, r"bag\.mcap: topic '/joint_states' has no joint torques"),
        ({"effort": [float("nan")] * 2}, "has no joint torques"),
        ({"velocity": None}, "has no joint velocities"),
        ({"name": None}, "does not name the joints"),
        ({"position": [1.0]}, "names 2 joints and has 1 joint_positions"),
        ({"effort": [1.0, float("nan")]}, r"row 0 .*torques of joint 'elbow' are nan"),
    ],
)
def test_what_a_model_cannot_be_learned_from_is_named(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        read_joint_log(bag(tmp_path / "bag.mcap", **changes))
    with pytest.raises(InputError, match=r"has no topic '/arm' for joint_states; it has /joint_states"):
        read_joint_log(tmp_path / "bag.mcap", "/arm")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stamps": np.array([1, 1, 2])}, r"row 1 .* does not come after the one before it"),
        ({"torques": np.ones((3, 1))}, r"torques have shape \(3, 1\), not 3 samples of 2 joints"),
        ({"stamps": np.array([1])}, "needs at least two samples, has 1"),
    ],
)
def test_a_log_that_does_not_hold_together_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        log(**changes)


STEP = 10**7
STAMPS = [10**9 + row * STEP for row in range(12)]
POSES = pose_messages(STAMPS, pose_rows(12))
HAND = [stamp + 1_000 for stamp in STAMPS[::3]]
ARM_POSITIONS = np.arange(24.0).reshape(12, 2)
HAND_POSITIONS = -np.arange(4.0)[:, None]


def joints(messages, path, **topics):
    return read_messages(path, [*POSES, *messages], joint_states="/joint_states", **topics)


def arm_and_hand():
    arm = joint_messages(STAMPS, ["a", "b"], ARM_POSITIONS, velocity=ARM_POSITIONS, effort=ARM_POSITIONS)
    return [*arm, *joint_messages(HAND, ["f"], HAND_POSITIONS)]


def test_the_publisher_of_most_joints_is_the_robot_and_the_other_one_is_told_of(tmp_path):
    recording = joints(arm_and_hand(), tmp_path / "bag.mcap")
    assert recording.joint_names == ("a", "b")
    assert recording.provenance["joints"] == "/joint_states: without f"
    for stream in recording.streams[1:]:
        np.testing.assert_array_equal(stream.stamps, STAMPS)
        np.testing.assert_array_equal(stream.values, ARM_POSITIONS)
    assert synchronise(recording).joint_names == ("a", "b")


def test_joints_that_are_named_are_taken_from_whoever_publishes_them(tmp_path):
    recording = joints(arm_and_hand(), tmp_path / "bag.mcap", joints=("f", "b"))
    assert recording.joint_names == ("f", "b")
    hand, arm = recording.streams[1:]
    np.testing.assert_array_equal(hand.stamps, HAND)
    np.testing.assert_array_equal(arm.values, ARM_POSITIONS[:, 1:])
    assert recording.provenance["joints"].startswith("joint_velocities are not of f and left out")
    with pytest.raises(InputError, match="has no joint g; it has a, b, f"):
        joints(arm_and_hand(), tmp_path / "bag.mcap", joints=("a", "g"))


def test_joints_of_two_clocks_stand_side_by_side_and_survive_our_own_file(tmp_path):
    recording = joints(arm_and_hand(), tmp_path / "bag.mcap", joints=("a", "b", "f"))
    demonstration = synchronise(recording, max_gap_s=1.0)
    assert demonstration.joint_positions.shape[1] == 3
    write_recording(recording, tmp_path / "own.mcap")
    back = read_recording(tmp_path / "own.mcap")
    assert back.joint_names == ("a", "b", "f")
    again = synchronise(back, max_gap_s=1.0)
    np.testing.assert_array_equal(again.joint_positions, demonstration.joint_positions)


@settings(max_examples=15, deadline=None)
@given(
    sets=st.lists(
        st.permutations(["a", "b", "c", "d"]).flatmap(lambda p: st.integers(1, 4).map(lambda n: p[:n])),
        min_size=2,
        max_size=12,
    )
)
def test_every_joint_has_the_samples_of_the_messages_that_name_it(tmp_path_factory, sets):
    """Messages may have any of the joints in any order; each value tells its joint and its message."""
    messages = []
    for row, names in enumerate(sets):
        values = [[100.0 * ord(name) + row for name in names]]
        messages += joint_messages([STAMPS[row]], names, values)
    wanted = tuple(dict.fromkeys(name for names in sets for name in names))
    recording = joints(messages, tmp_path_factory.mktemp("any") / "bag.mcap", joints=wanted)
    seen = {}
    for stream in recording.streams[1:]:
        for name, column in zip(stream.joints, stream.values.T, strict=True):
            seen[name] = (stream.stamps.tolist(), column.tolist())
    for name in wanted:
        rows = [row for row, names in enumerate(sets) if name in names]
        assert seen[name] == ([STAMPS[row] for row in rows], [100.0 * ord(name) + row for row in rows])


def test_joints_that_sometimes_come_together_are_one_publisher(tmp_path):
    """All of the arm at one pace, its wrist in between as well."""
    between = [stamp + STEP // 2 for stamp in STAMPS]
    messages = [
        *joint_messages(STAMPS, ["a", "b", "w"], np.ones((12, 3))),
        *joint_messages(between, ["w"], np.ones((12, 1))),
        *joint_messages(HAND, ["f", "g"], np.ones((4, 2))),
    ]
    recording = joints(messages, tmp_path / "bag.mcap")
    assert recording.joint_names == ("a", "b", "w")
    assert [len(stream.stamps) for stream in recording.streams[1:]] == [12, 24]
    assert recording.provenance["joints"] == "/joint_states: without f, g"


def test_a_log_of_an_arm_with_a_hand_on_its_topic(tmp_path):
    write_bag(tmp_path / "log.mcap", arm_and_hand())
    log = read_joint_log(tmp_path / "log.mcap")
    assert log.joints == ("a", "b")
    assert log.provenance["joints"] == "/joint_states: without f"
    np.testing.assert_array_equal(log.torques, ARM_POSITIONS)
    assert read_joint_log(tmp_path / "log.mcap", joints=["b"]).joints == ("b",)
    with pytest.raises(InputError, match="joints that come at different times: b and f"):
        read_joint_log(tmp_path / "log.mcap", joints=["b", "f"])


def test_signals_of_one_robot_may_name_joints_in_another_order(tmp_path):
    pose, *_ = make_recording().streams
    positions = Stream("/p", "joint_positions", pose.stamps, np.tile([1.0, 2.0], (40, 1)), ("a", "b"))
    torques = Stream("/t", "joint_torques", pose.stamps, np.tile([20.0, 10.0], (40, 1)), ("b", "a"))
    demonstration = synchronise(Recording("one", (pose, positions, torques)))
    assert demonstration.joint_names == ("a", "b")
    np.testing.assert_array_equal(demonstration.joint_torques[0], [10.0, 20.0])
    others = Stream("/t", "joint_torques", pose.stamps, torques.values, ("b", "c"))
    with pytest.raises(InputError, match="joint_torques are of the joints b, c, other signals of a, b"):
        synchronise(Recording("one", (pose, positions, others)))
