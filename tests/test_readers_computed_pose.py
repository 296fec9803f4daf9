"""Poses from joints by a URDF, and from chains of transforms, against closed form."""

from pathlib import Path

import numpy as np
import pinocchio
import pybullet_data
import pytest
from committed import topic_map
from readers_bags import (
    assert_same_poses,
    joint_messages,
    read_messages,
    transform_messages,
    transform_stamped,
    write_bag,
)

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers import StampPolicy, read_demonstrations

STEP = 10**7
STAMPS = [10**9 + row * STEP for row in range(30)]
UPPER_M, FORE_M = 0.5, 0.3
TWO_LINKS = f"""<robot name="two">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="tool"/><link name="finger"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="{UPPER_M} 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="wrist" type="fixed"><parent link="fore"/><child link="tool"/>
    <origin xyz="{FORE_M} 0 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
</robot>"""
PANDA = Path(pybullet_data.getDataPath()) / "franka_panda/panda.urdf"


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.urdf").write_text(TWO_LINKS)
    return tmp_path / "arm.urdf"


def read_arm(path, messages, urdf, tip, joints=None, units=None, **topics):
    """The pose of a link by the joint states of a bag, of which some joints may be renamed."""
    pose = {"urdf": str(urdf), "tip": tip, "topic": "/joint_states", "joints": joints or {}, "units": units}
    return read_messages(path / "bag.mcap", messages, pose=pose, **topics)


def two_link_pose(shoulder, elbow, grip=0.0):
    """By hand: (T, 7) of what stands `grip` beyond the tool."""
    both = shoulder + elbow
    reach = FORE_M + grip
    x = UPPER_M * np.cos(shoulder) + reach * np.cos(both)
    y = UPPER_M * np.sin(shoulder) + reach * np.sin(both)
    turned = quaternion.from_rotation_vector(both[:, None] * [0.0, 0.0, 1.0])
    return np.hstack([np.stack([x, y, np.zeros_like(x)], axis=1), turned])


def test_a_two_link_arm_by_hand(arm, tmp_path):
    time = np.arange(30) * 0.3
    shoulder, elbow, grip = np.sin(time), 1.1 * time, 0.1 + 0.05 * np.cos(time)  # the elbow turns round
    names = ["grip", "elbow", "elsewhere", "shoulder"]
    positions = np.stack([grip, elbow, time, shoulder], axis=1)
    messages = joint_messages(STAMPS, names, positions)
    for tip, far in (("tool", 0.0), ("finger", grip), ("fore", -FORE_M)):
        (pose,) = read_arm(tmp_path, messages, arm, tip).streams
        np.testing.assert_array_equal(pose.stamps, STAMPS)
        assert (pose.topic, pose.kind) == ("/joint_states", "pose")
        assert_same_poses(pose.values, two_link_pose(shoulder, elbow, far))
        assert (np.sum(pose.values[1:, 3:] * pose.values[:-1, 3:], axis=1) > 0).all()


def test_a_real_arm_is_where_pinocchio_says(tmp_path):
    model = pinocchio.buildModelFromUrdf(str(PANDA))
    rng = np.random.default_rng(0)
    steps = np.cumsum(0.02 * rng.normal(size=(len(STAMPS), 7)), axis=0)
    names = [f"panda_joint{number}" for number in range(1, 8)]
    order = rng.permutation(7)
    messages = joint_messages(STAMPS, [names[i] for i in order], steps[:, order], effort=steps[:, order])
    recording = read_arm(tmp_path, messages, PANDA, "panda_hand", joint_states="/joint_states")
    expected = np.empty((len(STAMPS), 7))
    data = model.createData()
    for row, angles in enumerate(steps):
        pinocchio.framesForwardKinematics(model, data, np.append(angles, [0.02, 0.02]))
        placed = pinocchio.SE3ToXYZQUAT(data.oMf[model.getFrameId("panda_hand")])
        expected[row] = [*placed[:3], placed[6], *placed[3:6]]
    assert_same_poses(recording.streams[0].values, expected)
    assert [stream.kind for stream in recording.streams] == ["pose", "joint_positions", "joint_torques"]
    assert recording.joint_names == tuple(names[i] for i in order)


def test_joints_in_messages_of_their_own_meet_on_the_slower_clock(arm, tmp_path):
    """Angles that grow at constant rate are met exactly between their samples."""
    fast = [10**9 + row * 3_333_333 for row in range(90)]
    slow = STAMPS[2:25]
    rate = np.array([0.4, -0.9])
    at = [(np.array(stamps) - 10**9)[:, None] * 1e-9 for stamps in (fast, slow)]
    messages = [
        *joint_messages(fast, ["shoulder"], rate[0] * at[0]),
        *joint_messages(slow, ["elbow"], rate[1] * at[1]),
    ]
    (pose,) = read_arm(tmp_path, messages, arm, "tool").streams
    np.testing.assert_array_equal(pose.stamps, slow)
    assert_same_poses(pose.values, two_link_pose(*(at[1] * rate).T), atol=1e-9)


def test_joints_may_have_other_names_in_the_urdf(arm, tmp_path):
    time = np.arange(30) * 0.3
    positions = np.stack([np.sin(time), 1.1 * time], axis=1)
    messages = joint_messages(STAMPS, ["axis_1", "elbow"], positions)
    (found,) = read_arm(tmp_path, messages, arm, "tool", {"axis_1": "shoulder"}).streams
    assert_same_poses(found.values, two_link_pose(*positions.T))
    with pytest.raises(InputError, match="has no joints axis_2, which the entry renames"):
        read_arm(tmp_path, messages, arm, "tool", {"axis_2": "shoulder"})


@pytest.mark.parametrize(
    ("names", "tip", "complaint"),
    [
        (["elbow"], "tool", r"bag.mcap: topic '/joint_states': lacks the joints shoulder, which move 'tool'"),
        (["shoulder", "elbow"], "finger", "lacks the joints grip, .* it has shoulder, elbow"),
        ([], "tool", "lacks the joints shoulder, elbow, .* it has no names"),
        (["shoulder", "elbow"], "hand", r"arm.urdf: has no link 'hand'; it has base, upper, fore, tool, fin"),
        (["shoulder", "elbow"], "base", r"arm.urdf: no joint moves link 'base'"),
    ],
)
def test_what_is_missing_is_named(arm, tmp_path, names, tip, complaint):
    positions = np.zeros((len(STAMPS), len(names) or 2))
    with pytest.raises(InputError, match=complaint):
        read_arm(tmp_path, joint_messages(STAMPS, names, positions), arm, tip)


def test_degrees_are_asked_for_by_the_limits_and_read_as_such(arm, tmp_path):
    """Also in the joint signal; a gripper that slides is in m either way."""
    time = np.arange(30) * 0.03
    angles, slide = np.stack([np.sin(time), 0.5 + time], axis=1), 0.1 + 0.1 * time
    names = ["shoulder", "elbow", "grip"]
    in_rad, in_deg = (
        joint_messages(STAMPS, names, np.column_stack([values, slide]))
        for values in (angles, np.degrees(angles))
    )
    signals = {"joint_states": "/joint_states"}
    expected, joints = read_arm(tmp_path, in_rad, arm, "finger", **signals).streams
    with pytest.raises(InputError, match=r"elbow goes to 78.5.*, which are more than two turns.*: degrees\?"):
        read_arm(tmp_path, in_deg, arm, "finger")
    pose, read = read_arm(tmp_path, in_deg, arm, "finger", units="deg", **signals).streams
    assert_same_poses(pose.values, expected.values)
    np.testing.assert_allclose(read.values, joints.values, atol=1e-12)
    with pytest.raises(InputError, match=r"no angle is above 1.37: rad, and not `units: deg`"):
        read_arm(tmp_path, in_rad, arm, "finger", units="deg")
    assert len(read_arm(tmp_path, in_deg, arm, "finger", units="rad").streams[0].stamps) == 30


def test_joints_of_a_table_may_be_in_degrees(arm, tmp_path):
    shoulder = np.linspace(60.0, 100.0, 30)
    rows = [f"{1.0 + 0.01 * row:.2f},0,0,0,{angle!r},20" for row, angle in enumerate(shoulder.tolist())]
    header = "time_s,x,y,z,position.shoulder,position.elbow"
    (tmp_path / "a.csv").write_text("\n".join([header, *rows]))
    pose = {"urdf": str(arm), "tip": "tool", "topic": "/joint_states"}
    with pytest.raises(InputError, match=r"shoulder goes to 100, beyond its limit of 3 rad in .*: degrees\?"):
        read_demonstrations(tmp_path, topic_map(pose=pose))
    (run,) = read_demonstrations(tmp_path, topic_map(pose=pose | {"units": "deg"}), rate_hz=100.0)
    expected = two_link_pose(np.radians(shoulder), np.radians(20.0) + 0.0 * shoulder)
    np.testing.assert_allclose(run.position, expected[:, :3], atol=1e-9)


def test_limits_of_a_urdf_in_degrees_are_named(arm, tmp_path):
    arm.write_text(TWO_LINKS.replace('lower="-3" upper="3"', 'lower="-170" upper="170"'))
    messages = joint_messages(STAMPS, ["shoulder", "elbow"], np.zeros((30, 2)))
    with pytest.raises(InputError, match=r"joint 'shoulder': limits -170 and 170 are in rad: degrees\?"):
        read_arm(tmp_path, messages, arm, "tool")


def test_a_urdf_of_pybullet_is_found_by_its_name(tmp_path):
    names = [f"panda_joint{number}" for number in range(1, 8)]
    messages = joint_messages(STAMPS, names, np.zeros((30, 7)) - 0.1)
    (pose,) = read_arm(tmp_path, messages, "franka_panda/panda.urdf", "panda_hand").streams
    (expected,) = read_arm(tmp_path, messages, PANDA, "panda_hand").streams
    np.testing.assert_array_equal(pose.values, expected.values)


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
