"""One source for each signal: publishers, frames, passes of a clock and descriptions that contradict it."""

import json

import numpy as np
import pytest
import yaml
from committed import EXAMPLE_TASK, topic_map
from mcap.writer import Writer
from readers_bags import (
    foreign_bag,
    joint_messages,
    pose_messages,
    transform_messages,
    transform_stamped,
    write_bag,
)

from structlearn.core.errors import InputError
from structlearn.readers import Recording, Stream, read_recording, read_recordings
from structlearn.readers.clock import clock_reset, in_order
from structlearn.readers.definitions import definition
from structlearn.readers.messages import to_messages
from structlearn.readers.raw_messages import read_bag
from structlearn.readers.raw_messages import write_bag as write_raw
from structlearn.readers.source import StampPolicy
from structlearn.tasks.task_import import on_clock

MS, START = 10**6, 10**9
STAMPS = START + 10 * MS * np.arange(300)
POLICIES = [StampPolicy(clock="header", disorder=disorder) for disorder in ("error", "drop", "sort")]
DROP = POLICIES[1]
TOOL, BOTH = topic_map(pose="/tool"), topic_map(pose="/tool", wrench="/wrist")
FRAME = topic_map(pose={"parent": "base", "child": "tool", "topic": "/tf"})
POSED = "geometry_msgs/msg/PoseStamped"


def poses(stamps, off=0.0, noise=2e-4):
    """Rows x, y, z, qw .. of a hand that goes back and forth, `off` m beside, with a sensor's noise."""
    time = 1e-9 * (np.asarray(stamps) - START)
    rows = np.zeros((len(time), 7))
    rows[:, 3] = 1.0
    rows[:, 0] = 0.2 * np.sin(2.0 * time) + off
    rows[:, :3] += np.random.default_rng(len(time)).normal(scale=noise, size=(len(time), 3))
    return rows


def forces(stamps, off=0.0):
    return np.random.default_rng(1).normal(scale=0.3, size=(len(stamps), 6)) + off


def channels(path, *signals):
    """A bag with a channel for each (topic, kind, stamps, values)."""
    about = {"provenance": json.dumps({"origin": "recorded"}), "true_segments": "null"}
    streams = [Stream(topic, kind, np.asarray(stamps), values) for topic, kind, stamps, values in signals]
    write_raw(path, about, [(stream.topic, to_messages("", stream)) for stream in streams])
    return path


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize(("late_ms", "every"), [(4, 1), (0, 1), (7, 5)])
def test_channels_that_contradict_each_other_are_refused(tmp_path, policy, late_ms, every):
    late = STAMPS[::every] + late_ms * MS
    pose, wrench = ("/tool", "pose", STAMPS, poses(STAMPS)), ("/wrist", "wrench", STAMPS, forces(STAMPS))
    words = r"comes from 2 channels, whose values differ at row|repeats the stamp"
    path = channels(tmp_path / "1.mcap", pose, ("/tool", "pose", late, poses(late, 0.02)))
    with pytest.raises(InputError, match=rf"1\.mcap: topic '/tool'.*({words})"):
        read_recording(path, TOOL, policy)
    path = channels(tmp_path / "1.mcap", pose, wrench, ("/wrist", "wrench", late, forces(late, 20.0)))
    with pytest.raises(InputError, match=rf"1\.mcap: topic '/wrist'.*({words})"):
        read_recording(path, BOTH, policy)


def test_channels_that_follow_or_repeat_each_other_are_one_source(tmp_path):
    first, second = STAMPS[:150], STAMPS[150:] + 3 * 10**9
    path = channels(
        tmp_path / "restarted.mcap",
        ("/tool", "pose", first, poses(first)),
        ("/tool", "pose", second, poses(second, 0.5)),
    )
    np.testing.assert_array_equal(read_recording(path, TOOL).streams[0].stamps, np.append(first, second))
    twice = ("/tool", "pose", STAMPS, poses(STAMPS))
    (pose,) = read_recording(channels(tmp_path / "twice.mcap", twice, twice), TOOL, DROP).streams
    np.testing.assert_array_equal(pose.values, poses(STAMPS))
    third = ("/tool", "pose", STAMPS[::3], poses(STAMPS)[::3])
    (pose,) = read_recording(channels(tmp_path / "throttled.mcap", twice, third), TOOL, DROP).streams
    np.testing.assert_array_equal(pose.values, poses(STAMPS))


@pytest.mark.parametrize("every", [1, 4])
def test_publishers_that_share_a_channel_show_in_values_that_go_to_and_fro(tmp_path, every):
    """As `ros2 bag record` writes them."""
    late = STAMPS[::every] + 3 * MS
    rows = pose_messages(STAMPS.tolist(), poses(STAMPS))
    rows += pose_messages(late.tolist(), poses(late, 0.02))
    write_bag(tmp_path / "1.mcap", sorted(rows, key=lambda row: row[3]))
    with pytest.raises(InputError, match=r"'/tool': values go to and fro, first at row \d+ "):
        read_recording(tmp_path / "1.mcap", TOOL, DROP)
    rows = joint_messages(STAMPS.tolist(), ["a", "b"], 1.0 + poses(STAMPS)[:, :2])
    rows += joint_messages(late.tolist(), ["a", "b"], np.zeros((len(late), 2)))
    write_bag(
        tmp_path / "2.mcap",
        sorted([*pose_messages(STAMPS.tolist(), poses(STAMPS)), *rows], key=lambda row: row[3]),
    )
    with pytest.raises(InputError, match=r"position of a, b: .* go to and fro"):
        read_recording(tmp_path / "2.mcap", topic_map(pose="/tool", joint_states="/joint_states"), DROP)


def test_noise_and_an_outlier_do_not_go_to_and_fro(tmp_path):
    rows = poses(STAMPS, noise=0.01)
    rows[100, 0] += 0.3
    write_bag(tmp_path / "1.mcap", pose_messages(STAMPS.tolist(), rows))
    (pose,) = read_recording(tmp_path / "1.mcap", TOOL).streams
    np.testing.assert_array_equal(pose.values, rows)


@pytest.mark.parametrize("policy", POLICIES)
def test_a_frame_that_changes_is_named(tmp_path, policy):
    rows = pose_messages(STAMPS.tolist(), poses(STAMPS))
    for number, row in enumerate(rows):
        row[2]["header"]["frame_id"] = "base" if number < 110 else "/base" if number < 120 else "tool"
    write_bag(tmp_path / "1.mcap", rows)
    with pytest.raises(InputError, match=r"'/tool': frame_id changes from base to tool at row 120 "):
        read_recording(tmp_path / "1.mcap", TOOL, policy)
    write_bag(tmp_path / "1.mcap", rows[:120])
    assert read_recording(tmp_path / "1.mcap", TOOL, policy).streams[0].frame == "base"
    kind = "geometry_msgs/msg/TransformStamped"
    bodies = ["tool"] * 10 + ["board"] * 10
    seen = [transform_stamped(int(s), "room", body, [0, 0, 0, 1, 0, 0, 0]) for s, body in zip(STAMPS, bodies)]  # noqa: B905
    rows = [("/tool", kind, message, int(s)) for s, message in zip(STAMPS, seen)]  # noqa: B905
    write_bag(tmp_path / "2.mcap", rows)
    with pytest.raises(InputError, match="child_frame_id changes from tool to board at row 10 "):
        read_recording(tmp_path / "2.mcap", TOOL, policy)


def test_recordings_of_a_task_have_one_frame():
    streams = [Stream("/tool", "pose", STAMPS, poses(STAMPS), frame=frame) for frame in ("base", "tool")]
    recordings = [Recording(str(number), (stream,)) for number, stream in enumerate(streams)]
    with pytest.raises(InputError, match="1: /tool: frame_id is tool, in 0 it is base"):
        list(on_clock(EXAMPLE_TASK, recordings, EXAMPLE_TASK.clock, {}))


def passes(count=300, back_s=1.5):
    """Stamps of a clock that is set back half-way."""
    return np.where(np.arange(count) < count // 2, STAMPS[:count], STAMPS[:count] - round(back_s * 1e9))


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("back_s", [0.3, 1.5, 100.0])
def test_a_clock_that_is_set_back_is_named_and_the_recorders_reads_it(tmp_path, policy, back_s):
    rows = pose_messages(passes(back_s=back_s).tolist(), poses(STAMPS), logged=STAMPS.tolist())
    write_bag(tmp_path / "1.mcap", rows)
    words = rf"'/tool': the clock goes back by {back_s - 0.01:.3g} s at row 150 \(.*`clock: log`"
    with pytest.raises(InputError, match=words):
        read_recording(tmp_path / "1.mcap", TOOL, policy)
    by_log = StampPolicy(clock="log", disorder="error")
    np.testing.assert_array_equal(read_recording(tmp_path / "1.mcap", TOOL, by_log).streams[0].stamps, STAMPS)


def test_a_recorder_whose_clock_is_set_back_does_not_mix_its_passes(tmp_path):
    again = passes()
    write_bag(tmp_path / "1.mcap", pose_messages(again.tolist(), poses(STAMPS)))
    for policy in (*POLICIES, StampPolicy(clock="log", disorder="sort")):
        with pytest.raises(InputError, match=r"the clock goes back by 1\.49 s at row 150"):
            read_recording(tmp_path / "1.mcap", TOOL, policy)
    write_bag(tmp_path / "2.mcap", pose_messages(STAMPS.tolist(), poses(STAMPS), logged=again.tolist()))
    (pose,) = read_recording(tmp_path / "2.mcap", TOOL).streams  # its headers are sound
    np.testing.assert_array_equal(pose.stamps, STAMPS)


def test_late_samples_outliers_and_a_clock_that_was_not_set_are_mended():
    late = np.concatenate([STAMPS[:100], STAMPS[150:200], STAMPS[100:150], STAMPS[200:]])
    rows, _ = in_order("", late, POLICIES[2])
    np.testing.assert_array_equal(late[rows], STAMPS)
    wild = STAMPS.copy()
    wild[[20, 21, 90]], wild[150] = 0, 10**15
    unset = np.append([10**18, 10**18 + 1, 10**18 + 2], STAMPS)
    jittery = STAMPS + np.random.default_rng(0).integers(-50 * MS, 50 * MS, 300)
    for stamps, kept in ((wild, 296), (unset, 300)):
        assert len(in_order("", stamps, DROP)[0]) == kept
    assert clock_reset(jittery) is None


STILL = [0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]
MOVED = [0.0, 0.15, 0.1, 1.0, 0.0, 0.0, 0.0]
STATIC = "/tf_static"


def transforms(*static, other=()):
    """The wrist moves in the base, the tool is fixed to it: `static` rows, 1 s apart."""
    rows = transform_messages(STAMPS.tolist(), "base", "wrist", poses(STAMPS)) + list(other)
    at = [START + 10**9 * number for number in range(len(static))]
    return sorted([*rows, *transform_messages(at, "wrist", "tool", static, STATIC)], key=lambda row: row[3])


LATE = (STAMPS[::2] + 4 * MS).tolist()
CONTRADICTORY = {
    "static": (
        transforms(STILL, MOVED),
        r"'/tf_static': the static transform from 'wrist' to 'tool' changes",
    ),
    "parents": (
        transforms(STILL, other=transform_messages(LATE, "other", "tool", poses(LATE))),
        "frame 'tool' has several parents: other, wrist",
    ),
    "publishers": (
        transforms(STILL, other=transform_messages(LATE, "base", "wrist", poses(LATE, 0.02))),
        "transform from 'base' to 'wrist': .* go to and fro",
    ),
    "topics": (
        transforms(STILL, other=transform_messages(LATE, "wrist", "tool", [MOVED] * len(LATE))),
        "transform from 'wrist' to 'tool' is another one in /tf and /tf_static",
    ),
    "cycle": (
        transforms(STILL, other=transform_messages(LATE, "wrist", "base", poses(LATE))),
        "each the parent of the other",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTORY)
@pytest.mark.parametrize("policy", POLICIES)
def test_transforms_that_contradict_each_other_are_refused(tmp_path, name, policy):
    rows, words = CONTRADICTORY[name]
    write_bag(tmp_path / "1.mcap", rows)
    with pytest.raises(InputError, match=words):
        read_recording(tmp_path / "1.mcap", FRAME, policy)


def test_many_publishers_of_transforms_are_normal(tmp_path):
    """Static ones that are published again, others on /tf too, and frames that have nothing to do with it."""
    other = transform_messages(LATE, "wrist", "tool", [STILL] * len(LATE))
    other += transform_messages(LATE, "odom", "base", poses(LATE))
    other += transform_messages(LATE[:1], "tool", "lens", [STILL], STATIC)
    other += transform_messages(LATE[1:2], "tool", "lens", [MOVED], STATIC)
    write_bag(tmp_path / "1.mcap", transforms(STILL, STILL, STILL, other=other))
    (pose,) = read_recording(tmp_path / "1.mcap", FRAME).streams
    np.testing.assert_array_equal(pose.stamps, STAMPS)


@pytest.mark.parametrize("late", [MS, 0])
def test_channels_of_a_transform_are_compared(tmp_path, late):
    """Each robot state publisher of a ROS 1 bag has its own."""
    with open(tmp_path / "1.mcap", "wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for stamps in (STAMPS, STAMPS[100:200:5]):
            first = len(stamps) == len(STAMPS)
            rows = poses(STAMPS) if first else poses(STAMPS)[100:200:5]
            stamps = stamps if first else stamps + late
            rows = transform_messages(stamps.tolist(), "base", "tool", rows)
            rows += transform_messages(stamps.tolist(), "tool", "lens", [STILL] * len(stamps))
            write_bag(tmp_path / "part.mcap", sorted(rows, key=lambda row: row[3]))
            raw = read_bag(tmp_path / "part.mcap", ["/tf"]).messages["/tf"]
            schema = writer.register_schema(raw.schemas[0].name, "ros2msg", raw.schemas[0].data)
            channel = writer.register_channel("/tf", "cdr", schema)
            for stamp, content in zip(raw.log_times.tolist(), raw.data, strict=True):
                writer.add_message(channel, stamp, content, stamp)
        writer.finish()
    topics = topic_map(pose={"parent": "base", "child": "lens", "topic": "/tf"})
    if late:
        with pytest.raises(InputError, match="from 'base' to 'tool': comes from 2 channels"):
            read_recording(tmp_path / "1.mcap", topics)
    else:
        assert len(read_recording(tmp_path / "1.mcap", topics, DROP).streams[0].stamps) == 300


def described(folder, files, count):
    """A bag folder with a description of its files and of the number of poses."""
    topics = [{"topic_metadata": {"name": "/tool", "type": POSED}, "message_count": count}]
    about = {"relative_file_paths": files, "message_count": count, "topics_with_message_count": topics}
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": about}))


def test_a_bag_is_held_against_its_description(tmp_path):
    rows = pose_messages(STAMPS.tolist(), poses(STAMPS))
    write_bag(tmp_path / "bag_0.mcap", rows)
    described(tmp_path, ["bag_0.mcap"], 300)
    for source in (tmp_path, tmp_path / "bag_0.mcap"):
        assert len(read_recordings(source, TOOL)[0].streams[0].stamps) == 300
        described(tmp_path, ["bag_0.mcap"], 310)
        with pytest.raises(InputError, match=r"'/tool' has 300 messages, metadata\.yaml says 310"):
            read_recordings(source, TOOL)
        described(tmp_path, ["bag_0.mcap"], 300)
    write_bag(tmp_path / "old.mcap", rows)
    with pytest.raises(InputError, match=r"metadata\.yaml does not list old\.mcap"):
        read_recordings(tmp_path, TOOL)


def test_a_stamp_of_more_than_a_second_of_nanoseconds_is_refused(tmp_path):
    rows = pose_messages(STAMPS.tolist(), poses(STAMPS))
    rows[7][2]["header"]["stamp"] = {"sec": 1, "nanosec": 1_200_000_000}
    write_bag(tmp_path / "1.mcap", rows)
    with pytest.raises(InputError, match=r"'/tool': a stamp is 1 s and 1200000000 ns: nanosec must be below"):
        read_recording(tmp_path / "1.mcap", TOOL, DROP)


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("ros2msg", definition(POSED).split("=" * 80)[0]),
        ("ros2msg", ""),
        ("", ""),
        ("ros2idl", "module geometry_msgs { };"),
    ],
)
def test_what_a_definition_lacks_is_that_of_ros(tmp_path, language, text):
    write_bag(tmp_path / "whole.mcap", pose_messages(STAMPS.tolist(), poses(STAMPS)))
    raw = read_bag(tmp_path / "whole.mcap", ["/tool"]).messages["/tool"]
    schema, rows = (POSED, language, text.encode()), list(zip(STAMPS.tolist(), raw.data, strict=True))
    (pose,) = read_recording(foreign_bag(tmp_path / "1.mcap", schema, rows), TOOL).streams
    np.testing.assert_array_equal(pose.values, poses(STAMPS))
    schema = (POSED, "ros2msg", b"std_msgs/Header header\nour_msgs/Pose pose\n")
    with pytest.raises(InputError, match="definition of geometry_msgs/PoseStamped lacks our_msgs/Pose"):
        read_recording(foreign_bag(tmp_path / "2.mcap", schema, rows), TOOL)


def test_fields_that_are_nan_throughout_are_left_out_and_others_are_named(tmp_path):
    rows, still = pose_messages(STAMPS.tolist(), poses(STAMPS)), np.ones((300, 3))
    topics = topic_map(pose="/tool", joint_states="/joint_states")
    names, effort, wheel = ["finger", "a", "b"], still.copy(), still.copy()
    effort[:, 0], wheel[:, 2] = np.nan, np.nan

    def joints(**fields):
        write_bag(tmp_path / "1.mcap", rows + joint_messages(STAMPS.tolist(), names, **fields))
        return read_recording(tmp_path / "1.mcap", topics)

    recording = joints(positions=still, velocity=still, effort=effort)
    assert [stream.kind for stream in recording.streams] == ["pose", "joint_positions", "joint_velocities"]
    assert recording.joint_names == tuple(names)
    assert recording.provenance["joints"] == "joint_torques are not of finger and left out"
    recording = joints(positions=wheel, velocity=still)
    assert [stream.joints for stream in recording.streams[1:]] == [("finger", "a")] * 2
    assert recording.provenance["joints"] == "without b, whose position was not recorded"
    effort[:, 0] = 1.0
    effort[:5, 0] = np.nan
    joints(positions=still, effort=effort)
    with pytest.raises(InputError, match=r"/joint_states: row 0 .*, effort of finger is nan"):
        read_recordings(tmp_path / "1.mcap", topics)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_an_orientation_that_is_nowhere_counts_as_not_recorded(tmp_path, value):
    rows = poses(STAMPS)
    rows[:, 3:] = value
    write_bag(tmp_path / "1.mcap", pose_messages(STAMPS.tolist(), rows))
    (recording,) = read_recordings(tmp_path / "1.mcap", TOOL)
    assert recording.provenance["orientation"] == "not recorded"
    np.testing.assert_array_equal(recording.streams[0].values[:, 3:], [[1.0, 0.0, 0.0, 0.0]] * 300)
    rows[:200, 3] = 1.0
    rows[:200, 4:] = 0.0
    write_bag(tmp_path / "1.mcap", pose_messages(STAMPS.tolist(), rows))
    with pytest.raises(InputError, match=r"row 200 .*(norm 0, not 1|column 3: value is nan)"):
        read_recordings(tmp_path / "1.mcap", TOOL)
