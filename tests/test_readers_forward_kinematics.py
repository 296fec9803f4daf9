"""Poses from joint states and a URDF."""

from pathlib import Path

import numpy as np
import pinocchio
import pybullet_data
import pytest
from committed import topic_map
from readers_bags import joint_messages, write_bag

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers import read_recording

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


def topics(urdf, tip, **others):
    return topic_map(pose={"urdf": str(urdf), "tip": tip, "topic": "/joint_states"}, **others)


def two_link_pose(shoulder, elbow, grip=0.0):
    """By hand: (T, 7) of what stands `grip` beyond the tool."""
    both = shoulder + elbow
    reach = FORE_M + grip
    x = UPPER_M * np.cos(shoulder) + reach * np.cos(both)
    y = UPPER_M * np.sin(shoulder) + reach * np.sin(both)
    turned = quaternion.from_rotation_vector(both[:, None] * [0.0, 0.0, 1.0])
    return np.hstack([np.stack([x, y, np.zeros_like(x)], axis=1), turned])


def assert_same_poses(values, expected, atol=1e-12):
    np.testing.assert_allclose(values[:, :3], expected[:, :3], atol=atol)
    assert quaternion.angle_between(values[:, 3:], expected[:, 3:]).max() < 1e-7
    assert (np.sum(values[1:, 3:] * values[:-1, 3:], axis=1) > 0).all()


def test_a_two_link_arm_by_hand(arm, tmp_path):
    time = np.arange(30) * 0.3
    shoulder, elbow, grip = np.sin(time), 1.1 * time, 0.1 + 0.05 * np.cos(time)  # the elbow turns round
    names = ["grip", "elbow", "elsewhere", "shoulder"]
    positions = np.stack([grip, elbow, time, shoulder], axis=1)
    write_bag(tmp_path / "bag.mcap", joint_messages(STAMPS, names, positions))
    for tip, far in (("tool", 0.0), ("finger", grip), ("fore", -FORE_M)):
        (pose,) = read_recording(tmp_path / "bag.mcap", topics(arm, tip)).streams
        np.testing.assert_array_equal(pose.stamps, STAMPS)
        assert (pose.topic, pose.kind) == ("/joint_states", "pose")
        assert_same_poses(pose.values, two_link_pose(shoulder, elbow, far))


def test_a_real_arm_is_where_pinocchio_says(tmp_path):
    model = pinocchio.buildModelFromUrdf(str(PANDA))
    rng = np.random.default_rng(0)
    steps = np.cumsum(0.02 * rng.normal(size=(len(STAMPS), 7)), axis=0)
    names = [f"panda_joint{number}" for number in range(1, 8)]
    order = rng.permutation(7)
    messages = joint_messages(STAMPS, [names[i] for i in order], steps[:, order], effort=steps[:, order])
    write_bag(tmp_path / "bag.mcap", messages)
    recording = read_recording(
        tmp_path / "bag.mcap", topics(PANDA, "panda_hand", joint_states="/joint_states")
    )
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
    write_bag(tmp_path / "bag.mcap", messages)
    (pose,) = read_recording(tmp_path / "bag.mcap", topics(arm, "tool")).streams
    np.testing.assert_array_equal(pose.stamps, slow)
    assert_same_poses(pose.values, two_link_pose(*(at[1] * rate).T), atol=1e-9)


def test_joints_may_have_other_names_in_the_urdf(arm, tmp_path):
    time = np.arange(30) * 0.3
    positions = np.stack([np.sin(time), 1.1 * time], axis=1)
    write_bag(tmp_path / "bag.mcap", joint_messages(STAMPS, ["axis_1", "elbow"], positions))
    pose = {"urdf": str(arm), "tip": "tool", "topic": "/joint_states"}
    renamed = topic_map(pose=pose | {"joints": {"axis_1": "shoulder"}})
    (found,) = read_recording(tmp_path / "bag.mcap", renamed).streams
    assert_same_poses(found.values, two_link_pose(*positions.T))
    with pytest.raises(InputError, match="has no joints axis_2, which the entry renames"):
        read_recording(tmp_path / "bag.mcap", topic_map(pose=pose | {"joints": {"axis_2": "shoulder"}}))


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
    write_bag(tmp_path / "bag.mcap", joint_messages(STAMPS, names, positions))
    with pytest.raises(InputError, match=complaint):
        read_recording(tmp_path / "bag.mcap", topics(arm, tip))
