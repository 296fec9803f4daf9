"""Messages of a user's robot: columns against the library's decoder, and every supported type."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from committed import topic_map
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
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
from structlearn.readers import decoded_messages

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


def test_the_log_time_stands_in_only_where_no_header_is_set_whatever_the_slashes_of_frames(
    tmp_path,
):
    messages = pose_messages(STAMPS, ROWS)
    unset = [(*m[:2], m[2] | {"header": header(0)}, m[3]) for m in messages]
    (pose,) = read_messages(tmp_path / "bag.mcap", unset).streams
    np.testing.assert_array_equal(pose.stamps, STAMPS)
    simulated = [0, 10**7, 2 * 10**7]
    from_zero = pose_messages(simulated, ROWS[:3], logged=range(10**18, 10**18 + 3))
    (pose,) = read_messages(tmp_path / "bag.mcap", from_zero).streams
    np.testing.assert_array_equal(pose.stamps, simulated)
    for number, (_, _, message, _) in enumerate(messages):
        message["header"]["frame_id"] = "/" * (number % 3) + "base"
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


NUMBERS = {
    "float64": st.floats(allow_nan=False),
    "float32": st.floats(width=32, allow_nan=False),
    "int8": st.integers(-(2**7), 2**7 - 1),
    "uint8": st.integers(0, 2**8 - 1),
    "int16": st.integers(-(2**15), 2**15 - 1),
    "uint16": st.integers(0, 2**16 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "bool": st.booleans(),
}


def encoded(text, messages):
    """Bytes of each message of pkg/msg/Own, and what the library decodes."""
    file = BytesIO()
    writer = Writer(file)
    schema = writer.register_msgdef("pkg/msg/Own", text)
    for message in messages:
        writer.write_message("/topic", schema, message, 0)
    writer.finish()
    file.seek(0)
    rows = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    return [row.message.data for row in rows], [row.decoded_message for row in rows]


def columns(text, data):
    table = np.frombuffer(b"".join(data), dtype=np.uint8).reshape(len(data), -1)
    fields, alike = decoded_messages.columns("pkg/msg/Own", text, table) or (None, np.zeros(1))
    return fields if alike.all() else None


def assert_same(column, values):
    """A field of the columns against that of every message."""
    if isinstance(column, np.ndarray):
        expected = [list(value) if isinstance(value, bytes) else value for value in values]
        np.testing.assert_array_equal(column, np.array(expected).reshape(column.shape))
    elif isinstance(column, SimpleNamespace):
        for name, inner in vars(column).items():
            assert_same(inner, [getattr(value, name) for value in values])
    elif isinstance(column, list) and column and isinstance(column[0], SimpleNamespace):
        for place, inner in enumerate(column):
            assert_same(inner, [value[place] for value in values])
    else:
        assert [column] * len(values) == values


@st.composite
def definitions(draw, depth=2):
    """Text of a definition as lines and nested types, and a strategy of its messages, all of one layout."""
    lines, nested, fields = [], {}, {}
    kinds = [*NUMBERS, "string", *(["nested"] if depth else [])]
    for number, kind in enumerate(draw(st.lists(st.sampled_from(kinds), min_size=1, max_size=5))):
        many = draw(st.sampled_from(["", "[]", "[3]", "[<=4]"]))
        length = {"": None, "[3]": 3}.get(many, draw(st.integers(0, 4)))
        if kind == "nested":
            inner_lines, inner_nested, one = draw(definitions(depth - 1))
            kind = f"Inner{depth}{number}x{len(inner_nested)}{draw(st.integers(0, 9**6))}"
            nested |= inner_nested | {f"pkg/{kind}": inner_lines}
        elif kind == "string":
            one = st.just(draw(st.text(max_size=5).filter(lambda text: "\0" not in text)))
        else:
            one = NUMBERS[kind]
        lines += [f"{kind}{many} f{number}  # what it is", "# = a comment", f"int32 LIMIT_{number} = 3"]
        fields[f"f{number}"] = one if length is None else st.lists(one, min_size=length, max_size=length)
    return lines, nested, st.fixed_dictionaries(fields)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_columns_are_what_the_library_decodes(data):
    lines, nested, messages = data.draw(definitions())
    text = "\n".join(lines)
    text += "".join(f"\n{'=' * 80}\nMSG: {name}\n" + "\n".join(inner) for name, inner in nested.items())
    raw, decoded = encoded(text, data.draw(st.lists(messages, min_size=1, max_size=3)))
    fields = columns(text, raw)
    assert fields is not None
    assert_same(fields, decoded)


@pytest.mark.parametrize(
    "text", ["", "wstring name\n", "Unknown x\n", "float64 x[3]\n", "float64 x\nfloat64 y\n", "int32[] a\n"]
)
def test_definitions_and_encodings_that_are_rare_or_do_not_fit_have_no_columns(text):
    assert columns(text, [b"\0\1\0\0" + b"\xff" * 8]) is None
    assert columns(text, [b"\0\1"]) is None
    for encapsulation in (b"\0\0\0\0", b"\0\3\0\0", b"\0\7\0\0"):
        assert columns("float64 x\n", [encapsulation + bytes(8)]) is None
