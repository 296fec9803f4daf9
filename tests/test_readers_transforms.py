"""Poses from chains of transforms, against closed form."""

import numpy as np
import pytest
from committed import topic_map
from readers_bags import assert_same_poses, read_messages, transform_messages, transform_stamped, write_bag

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers import StampPolicy, read_demonstrations

START = 10**9
TURN_RAD_S, SLIDE_M_S = 0.7, 0.2
ARM_M = 0.3
UPRIGHT = quaternion.from_rotation_vector([np.pi / 2, 0.0, 0.0])
TOOL_ON_LINK = [ARM_M, 0.0, 0.0, *UPRIGHT]
SLOW, FAST = 10**9 // 40, 10**9 // 90


def clock(step, count, late=0):
    return [START + late + row * step for row in range(count)]


def turns(stamps):
    """A link that turns about z at constant rate, which slerp meets exactly."""
    angle = TURN_RAD_S * (np.array(stamps) - START) * 1e-9
    turned = quaternion.from_rotation_vector(angle[:, None] * [0.0, 0.0, 1.0])
    return np.hstack([np.zeros((len(stamps), 3)), turned])


def slides(stamps):
    """A carriage that slides along y at constant speed."""
    way = SLIDE_M_S * (np.array(stamps) - START) * 1e-9
    return np.array([[0.0, y, 0.5, 1.0, 0.0, 0.0, 0.0] for y in way])


def tool_at(stamps):
    """The tool in the rail's frame, (T, 7)."""
    time = (np.array(stamps) - START) * 1e-9
    angle = TURN_RAD_S * time
    turned = quaternion.product(quaternion.from_rotation_vector(angle[:, None] * [0, 0, 1.0]), UPRIGHT)
    position = np.stack(
        [ARM_M * np.cos(angle), SLIDE_M_S * time + ARM_M * np.sin(angle), np.full_like(angle, 0.5)], axis=1
    )
    return np.hstack([position, turned])


def messages(carriage, link):
    return [
        *transform_messages(carriage, "rail", "carriage", slides(carriage)),
        *transform_messages(link, "/carriage", "/link", turns(link)),  # ROS 1 puts slashes before frames
        *transform_messages([START], "link", "tool", [TOOL_ON_LINK], "/tf_static"),
        *transform_messages(link, "link", "elsewhere", slides(link)),
    ]


def pose_of(path, parent, child, rows, *policy):
    return read_messages(path, rows, *policy, pose={"parent": parent, "child": child, "topic": "/tf"})


def test_moving_and_static_transforms_are_composed_on_the_clock_of_the_slowest(tmp_path):
    carriage, link = clock(SLOW, 40), clock(FAST, 91, late=3_000_001)
    recording = pose_of(tmp_path / "bag.mcap", "rail", "tool", messages(carriage, link))
    (pose,) = recording.streams
    inside = [stamp for stamp in carriage if link[0] <= stamp <= link[-1]]
    np.testing.assert_array_equal(pose.stamps, inside)
    assert_same_poses(pose.values, tool_at(inside))
    assert (pose.topic, pose.kind) == ("/tf", "pose")


CAMERA = [1.0, 2.0, 3.0, *quaternion.from_rotation_vector([0.0, np.pi, 0.0])]
TIP = [0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]


def inverse(pose):
    turned = quaternion.conjugate(pose[..., 3:])
    return np.concatenate([-quaternion.rotate(turned, pose[..., :3]), turned], axis=-1)


def composed(first, second):
    position = first[..., :3] + quaternion.rotate(first[..., 3:], second[..., :3])
    return np.concatenate([position, quaternion.product(first[..., 3:], second[..., 3:])], axis=-1)


@pytest.mark.parametrize(
    ("parent", "child", "expected"),
    [
        ("tool", "rail", inverse),
        # a camera on the rail sees the tool: up from the camera, down to the tool
        ("camera", "tool", lambda tool: composed(inverse(np.array(CAMERA)), tool)),
        ("rail", "tip", lambda tool: composed(tool, np.array(TIP))),  # once on /tf: it has no clock
    ],
)
def test_chains_go_up_down_and_over_what_is_fixed(tmp_path, parent, child, expected):
    stamps = clock(SLOW, 20)
    rows = [*messages(stamps, stamps), *transform_messages([0], "rail", "camera", [CAMERA], "/tf_static")]
    rows += transform_messages([START], "tool", "tip", [TIP])
    (pose,) = pose_of(tmp_path / "bag.mcap", parent, child, rows).streams
    np.testing.assert_array_equal(pose.stamps, stamps)
    assert_same_poses(pose.values, expected(tool_at(stamps)))


def test_several_transforms_of_one_message(tmp_path):
    """With a layout that changes: how a message is decoded makes no difference."""
    stamps = clock(SLOW, 12)
    pairs = zip(stamps, slides(stamps), turns(stamps), strict=True)
    rows = []
    for number, (s, slid, turned) in enumerate(pairs):
        both = [
            transform_stamped(s, "rail", "carriage", slid),
            transform_stamped(s, "carriage", "link", turned),
        ]
        other = [transform_stamped(s, "rail", "other" * (number % 3), slid)] * (number % 2)
        rows.append(("/tf", "tf2_msgs/msg/TFMessage", {"transforms": both + other}, s))
    rows += transform_messages([0], "link", "tool", [TOOL_ON_LINK], "/tf_static")
    (pose,) = pose_of(tmp_path / "bag.mcap", "rail", "tool", rows).streams
    np.testing.assert_array_equal(pose.stamps, stamps)
    assert_same_poses(pose.values, tool_at(stamps))


def test_a_hole_in_the_faster_transform_is_not_hidden(tmp_path):
    carriage, link = clock(SLOW, 40), clock(FAST, 91)
    hole = [stamp for stamp in link if not 0.3 < (stamp - START) * 1e-9 < 0.7]
    topics = topic_map(pose={"parent": "rail", "child": "tool", "topic": "/tf"})
    write_bag(tmp_path / "bag.mcap", messages(carriage, hole))
    with pytest.raises(InputError, match=r"/tf: row \d+ .* is followed by a gap of 0\.[45]"):
        read_demonstrations(tmp_path / "bag.mcap", topics)
    (demonstration,) = read_demonstrations(tmp_path / "bag.mcap", topics, max_gap_s=0.6)
    assert demonstration.time[-1] > 0.9


@pytest.mark.parametrize(
    ("parent", "child", "complaint"),
    [
        ("rail", "hand", "has no frame 'hand'; it has carriage, elsewhere, island, link, rail, sea, tool"),
        ("rail", "island", "no transforms lead from 'rail' to 'island', only to carriage, elsewhere"),
        ("link", "tool", "'tool' does not move in 'link'"),
    ],
)
def test_frames_that_cannot_be_had_are_named(tmp_path, parent, child, complaint):
    stamps = clock(SLOW, 5)
    rows = [*messages(stamps, stamps), *transform_messages(stamps, "sea", "island", slides(stamps))]
    with pytest.raises(InputError, match=rf"bag\.mcap: topic '/tf': {complaint}"):
        pose_of(tmp_path / "bag.mcap", parent, child, rows)


STILL = clock(SLOW, 5)
MOCAP = transform_messages(STILL, "mocap", "link", slides(STILL))
STATIC = transform_messages([START], "rail", "tool", [TOOL_ON_LINK], "/tf_static")
NO_TURN = transform_messages(STILL, "rail", "tool", np.zeros((5, 7)))
APART = messages(clock(SLOW, 10), clock(FAST, 10, late=10**9))


@pytest.mark.parametrize(
    ("rows", "complaint"),
    [
        (messages(STILL, STILL) + MOCAP, "frame 'link' has several parents: carriage, mocap"),
        (NO_TURN, "transform from 'rail' to 'tool': quaternion has norm 0, not 1"),
        (APART, "'rail' to 'carriage', 'carriage' to 'link' are not there at one"),
        (STATIC, r"has no topic '/tf' for transforms; it has /tf_static \(tf2_msgs"),
    ],
)
def test_transforms_that_do_not_lead_to_a_pose_are_named(tmp_path, rows, complaint):
    with pytest.raises(InputError, match=complaint):
        pose_of(tmp_path / "bag.mcap", "rail", "tool", rows)


def test_transforms_published_twice_follow_the_policy(tmp_path):
    stamps = clock(SLOW, 10)
    rows = messages(stamps, stamps)
    rows += rows[10:11]
    with pytest.raises(InputError, match=r"transform from 'carriage' to 'link': row 1 .* repeats"):
        pose_of(tmp_path / "bag.mcap", "rail", "tool", rows)
    drop = StampPolicy(clock="header", disorder="drop")
    recording = pose_of(tmp_path / "bag.mcap", "rail", "tool", rows, drop)
    assert recording.provenance["stamps"] == "/tf: 1 dropped of 11 of transform from 'carriage' to 'link'"
    assert_same_poses(recording.streams[0].values, tool_at(stamps))
