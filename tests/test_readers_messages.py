"""Bags of a user's robot, with every supported message type."""

import numpy as np
import pytest
from committed import topic_map
from pydantic import ValidationError
from readers_bags import (
    header,
    pose_messages,
    pose_rows,
    read_messages,
    ros_pose,
    ros_quaternion,
    transform_stamped,
    vector,
)

from structlearn.core.errors import InputError

STAMPS = [10**9 + 7_000_001 * row for row in range(5)]
ROWS = pose_rows(5)
LATE = 3_000_000  # ns from header stamp to log time


def pose_stamped(stamp, row):
    return {"header": header(stamp), "pose": ros_pose(row)}


POSES = {
    "geometry_msgs/msg/PoseStamped": pose_stamped,
    "geometry_msgs/PoseStamped": pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda stamp, row: {
        "header": header(stamp),
        "pose": {"pose": ros_pose(row), "covariance": [0.1] * 36},
    },
    "geometry_msgs/msg/TransformStamped": lambda stamp, row: transform_stamped(stamp, "base", "tool", row),
    "nav_msgs/msg/Odometry": lambda stamp, row: {
        "header": header(stamp),
        "child_frame_id": "tool",
        "pose": {"pose": ros_pose(row)},
        "twist": {"twist": {"linear": vector([9, 9, 9])}},
    },
    "geometry_msgs/msg/Pose": lambda _, row: ros_pose(row),
}


def read(path, messages, **topics):
    """Streams besides the pose, read from a bag that has a pose too."""
    return read_messages(path, [*pose_messages(STAMPS, ROWS), *messages], **topics).streams[1:]


@pytest.mark.parametrize("message_type", POSES)
def test_every_pose_type_gives_the_same_scalar_first_pose(tmp_path, message_type):
    """Also of the tool to the board: how it is turned."""
    messages = [
        (topic, message_type, POSES[message_type](s, row), s + LATE)
        for topic in ("/tool", "/mocap")
        for s, row in zip(STAMPS, ROWS, strict=True)
    ]
    seen = {"tool_to_board": "/mocap"} if message_type in TURNS else {}
    recording = read_messages(tmp_path / "bag.mcap", messages, **seen)
    pose, *mocap = recording.streams
    assert (pose.kind, pose.topic, recording.name) == ("pose", "/tool", "bag")
    np.testing.assert_array_equal(pose.values, ROWS)
    late = LATE if message_type.endswith("/Pose") else 0  # no header: the log time is the stamp
    for stream in recording.streams:
        np.testing.assert_array_equal(stream.stamps, np.array(STAMPS) + late)
    for stream in mocap:
        assert (stream.kind, message_type in TURNS) == ("tool_to_board", True)
        np.testing.assert_array_equal(stream.values, ROWS[:, 3:])
    assert recording.provenance == {"origin": "recorded", "source": "bag.mcap"}


TURNS = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TransformStamped")
"""That motion capture publishes, where only how the tool is turned counts."""


COUNTS = [[row, 2 * row, 4095] for row in range(5)]
TURNED = [
    {"header": header(s), "quaternion": ros_quaternion(row[3:])} for s, row in zip(STAMPS, ROWS, strict=True)
]


def two_vectors(role, first, second):
    """Messages of a twist or a wrench, and their values."""
    rows = [[1, 2, s, 4, 5, 6] for s in STAMPS]
    both = [
        {"header": header(row[2]), role: {first: vector(row[:3]), second: vector(row[3:])}} for row in rows
    ]
    return f"geometry_msgs/msg/{role.title()}Stamped", both, role, rows, 0


@pytest.mark.parametrize(
    ("message_type", "messages", "role", "values", "late"),
    [
        two_vectors("twist", "linear", "angular"),
        two_vectors("wrench", "force", "torque"),
        *(
            (f"std_msgs/msg/{one}MultiArray", [{"data": data} for data in COUNTS], "tactile", COUNTS, LATE)
            for one in ("Float32", "Float64", "Int16", "Int32", "UInt16")
        ),
        ("geometry_msgs/msg/QuaternionStamped", TURNED, "tool_to_board", ROWS[:, 3:], 0),
    ],
)
def test_other_streams_are_stamped_by_their_header_and_touch_by_its_log_time(
    tmp_path, message_type, messages, role, values, late
):
    rows = [("/x", message_type, one, s + LATE) for s, one in zip(STAMPS, messages, strict=True)]
    (stream,) = read(tmp_path / "bag.mcap", rows, **{role: "/x"})
    assert stream.kind == role
    np.testing.assert_array_equal(stream.values, values)
    np.testing.assert_array_equal(stream.stamps, np.array(STAMPS) + late)


def test_the_log_time_stands_in_only_where_no_header_is_set_and_frames_make_no_difference(tmp_path):
    messages = pose_messages(STAMPS, ROWS)
    unset = [(*m[:2], m[2] | {"header": header(0)}, m[3]) for m in messages]
    (pose,) = read_messages(tmp_path / "bag.mcap", unset).streams
    np.testing.assert_array_equal(pose.stamps, STAMPS)
    simulated = [0, 10**7, 2 * 10**7]
    from_zero = pose_messages(simulated, ROWS[:3], logged=range(10**18, 10**18 + 3))
    (pose,) = read_messages(tmp_path / "bag.mcap", from_zero).streams
    np.testing.assert_array_equal(pose.stamps, simulated)
    for number, (_, _, message, _) in enumerate(messages):
        message["header"]["frame_id"] = "base" * (number % 3)
    (pose,) = read_messages(tmp_path / "bag.mcap", messages).streams
    np.testing.assert_array_equal(pose.stamps, STAMPS)
    np.testing.assert_array_equal(pose.values, ROWS)


def test_roles_of_topics_have_an_order_and_each_topic_one_role():
    topics = topic_map(tactile=("/b", "/a"), pose="/tool", joint_states="/joints")
    roles = [("/tool", "pose"), ("/joints", "joint_states"), ("/b", "tactile"), ("/a", "tactile")]
    assert topics.roles() == roles
    for wrong in ({"pose": "/a", "wrench": "/a"}, {"pose": "/a", "tactile": [""]}, {"pose": None}):
        with pytest.raises(ValidationError):
            topic_map(**wrong)


def joint_message(stamp, **fields):
    return ("/joints", "sensor_msgs/msg/JointState", {"header": header(stamp), **fields}, stamp)


NO = [np.nan, np.nan]


@pytest.mark.parametrize(
    ("states", "streams"),
    [
        (  # a stream for each field that is filled, in the first order of names
            [
                {"name": ["a", "b"], "position": [1, 2], "effort": [3, 4]},
                {"name": ["b", "a"], "position": [20, 10], "effort": [40, 30]},
            ],
            {"joint_positions": [[1, 2], [10, 20]], "joint_torques": [[3, 4], [30, 40]]},
        ),
        (  # what the driver does not measure is left out
            [{"name": ["a", "b"], "position": [1, 2], "velocity": [3, 4], "effort": NO}] * 2,
            {"joint_positions": [[1, 2]] * 2, "joint_velocities": [[3, 4]] * 2},
        ),
        ([{"velocity": [5, 6]}] * 2, {"joint_velocities": [[5, 6]] * 2}),  # without names
    ],
)
def test_joint_states_give_a_stream_per_filled_field(tmp_path, states, streams):
    messages = [joint_message(s, **state) for s, state in zip(STAMPS, states, strict=False)]
    found = read(tmp_path / "bag.mcap", messages, joint_states="/joints")
    assert {one.kind: one.values.tolist() for one in found} == streams


FIRST = {"name": ["a", "b"], "position": [1, 2]}


def joints(*messages):
    states = [joint_message(s, **one) for s, one in zip(STAMPS, messages, strict=False)]
    return states, {"joint_states": "/joints"}


def counts(*lengths):
    kind = "std_msgs/msg/Int16MultiArray"
    rows = zip(lengths, STAMPS, strict=False)
    return [("/finger", kind, {"data": [1] * n}, s) for n, s in rows], {"tactile": "/finger"}


def words(**topics):
    return [("/words", "std_msgs/msg/String", {"data": "hello"}, s) for s in STAMPS], topics


UNKNOWN = "topic '/words' has messages of type std_msgs/msg/String; "


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (joints(FIRST, {"name": ["a", "a"]}), r"joints'.* row 1 \(stamp 1\.007000001 s\) names joint 'a'"),
        (joints(FIRST, {"position": [1, 2]}), "joints'.* row 1 .* names no joints, other messages do"),
        (joints(FIRST, {"name": ["a", "b"], "position": [1]}), "row 1 .* has 1 values, the first has 2"),
        (joints(FIRST, {"name": ["a", "b"]}), "row 1 .* has 0 values, the first has 2"),
        (joints({"name": ["a"]}), "without position, velocity and effort"),
        (joints(FIRST | {"position": [1, 2, 3]}), "names 2 joints and has 3 joint_positions per message"),
        (counts(3, 3, 2), r"finger': row 2 \(stamp 1\.014000002 s\) has 2 values, the first has 3"),
        (counts(0, 0, 0), "finger': messages have no values"),
        (words(pose="/words"), UNKNOWN + "pose .*geometry_msgs/PoseStamped.*nav_msgs/Odometry"),
        (words(tactile=("/words",)), UNKNOWN + "tactile .*std_msgs/Float32MultiArray"),
    ],
)
def test_messages_that_cannot_be_read_are_named_with_topic_and_row(tmp_path, content, complaint):
    messages, topics = content
    with pytest.raises(InputError, match=rf"bag\.mcap: .*{complaint}"):
        read(tmp_path / "bag.mcap", messages, **topics)
