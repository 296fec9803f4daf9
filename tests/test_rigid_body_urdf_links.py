"""Names in a URDF, found without building the robot."""

import pytest

from structlearn.ground.errors import InputError
from structlearn.rigid_body.urdf import moving_joints, tips
from structlearn.simulation.arm import urdf_path

ARM = [f"panda_joint{joint + 1}" for joint in range(7)]
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]


def write_urdf(path, joints):
    """Joints as (name, kind, parent, child)."""
    lines = [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for name, kind, parent, child in joints
    ]
    path.write_text(f"<robot name='r'>{''.join(lines)}</robot>")
    return path


def test_the_hand_of_a_panda_is_neither_a_finger_nor_a_link_before_it():
    panda = urdf_path("franka_panda/panda.urdf")
    assert moving_joints(panda) == ARM + FINGERS
    assert tips(panda, ARM) == ["panda_grasptarget"]
    assert tips(panda, ARM + FINGERS) == ["panda_grasptarget", "panda_leftfinger", "panda_rightfinger"]
    assert tips(panda, ARM[:3]) == ["panda_link3"]
    assert tips(panda, []) == []


def test_without_a_name_for_a_hand_it_is_the_link_behind_the_most_joints(tmp_path):
    joints = [
        ("a", "revolute", "base", "one"),
        ("b", "revolute", "one", "two"),
        ("c", "fixed", "base", "camera"),
        ("d", "revolute", "base", "wheel"),
    ]
    assert tips(write_urdf(tmp_path / "robot.urdf", joints), "abd") == ["two", "wheel"]


def test_a_circle_of_links_ends(tmp_path):
    joints = [("a", "revolute", "one", "two"), ("b", "revolute", "two", "one")]
    assert tips(write_urdf(tmp_path / "robot.urdf", joints), "ab") == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such URDF"),
        ("<robot", "cannot be read"),
        ("<robot/>", "no joints"),
        ("<robot><joint name='a'/></robot>", "'a' has no parent"),
    ],
)
def test_what_is_no_urdf_is_said(tmp_path, content, message):
    path = tmp_path / "robot.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message):
        moving_joints(path)
