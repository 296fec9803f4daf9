import re

import numpy as np
import pytest
from rigid_body_robots import FINGERS, joint, link, robot

from structlearn.core.errors import InputError
from structlearn.rigid_body.tree import joint_order, read_urdf
from structlearn.rigid_body.urdf import counterparts, moving_joints, tips
from structlearn.simulation.arm import urdf_path

BODY = link("moved")
HINGE = joint("hinge", "revolute", "base", "moved")
ARM = [f"panda_joint{joint + 1}" for joint in range(7)]


def file(body=BODY, hinge=HINGE, more=""):
    return f'<robot name="arm"><link name="base"/>{body}{hinge}{more}</robot>'


def write(folder, **parts):
    path = folder / "arm.urdf"
    path.write_text(file(**parts))
    return path


def test_a_tree_is_what_the_file_says():
    tree = robot("odd").tree
    assert set(tree.names) == {"slide", "skewed", "endless", "skewed_slide", "wrist", "endless_skewed"}
    at = {name: index for index, name in enumerate(tree.names)}
    parents = {
        name: tree.names[parent] if parent >= 0 else ""
        for name, parent in zip(tree.names, tree.parents, strict=True)
    }
    assert parents == {
        "slide": "", "skewed": "slide", "endless": "skewed", "skewed_slide": "skewed",
        "wrist": "skewed_slide", "endless_skewed": "wrist",
    }  # fmt: skip
    assert (tree.parents < np.arange(6)).all()
    assert [name for name in tree.names if tree.prismatic[at[name]]] == ["slide", "skewed_slide"]
    np.testing.assert_allclose(tree.axis[at["skewed"]], np.array([1.0, 2.0, -0.5]) / np.sqrt(5.25))
    np.testing.assert_allclose(tree.axis[at["endless_skewed"]], np.ones(3) / np.sqrt(3.0))
    np.testing.assert_allclose(tree.axis[at["endless"]], [0.0, 0.0, -1.0], atol=1e-15)
    assert (tree.lower[at["endless"]], tree.upper[at["endless"]]) == (-np.inf, np.inf)
    assert (tree.lower[at["skewed"]], tree.upper[at["skewed"]]) == (-1.5, 2.0)
    assert (tree.velocity[at["skewed"]], tree.velocity[at["endless_skewed"]]) == (3.0, 2.0)
    np.testing.assert_allclose(tree.translation[at["wrist"]], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(tree.gravity, [0.0, 0.0, -9.81])


def test_links_at_fixed_and_locked_joints_belong_to_those_that_carry_them():
    assert robot("odd").inertias.mass[-1] == pytest.approx(0.4 + 0.5)
    assert len(robot("panda").tree.names) == 7
    assert len(robot("panda_hand").tree.names) == 9
    assert robot("panda").inertias.mass.sum() == pytest.approx(robot("panda_hand").inertias.mass.sum())


def test_a_massless_link_may_move_what_is_fixed_to_it(tmp_path):
    """As flanges in many URDFs."""
    more = link("tool", 0.8) + joint("bolt", "fixed", "moved", "tool")
    assert read_urdf(write(tmp_path, body='<link name="moved"/>', more=more)).inertias.mass == [0.8]


NUMBER = link("moved").replace('mass value="1.0"', 'mass value="{}"')


def hinge(limit, kind="revolute", axis="0 0 1"):
    return joint("hinge", kind, "base", "moved", limit=limit, axis=axis)


LIMIT = '<limit lower="{}" upper="{}" velocity="{}" effort="1"/>'
GOOD = LIMIT.format(-1, 1, 1)
BAD_BODIES = {
    "link that joint 'hinge' moves has no mass: <inertial> is absent or zero": [
        '<link name="moved"/>',
        NUMBER.format(0),
    ],
    "link 'moved': mass -2 kg is negative": [NUMBER.format(-2)],
    "link 'moved': mass: a value is missing or no number": [NUMBER.format("heavy"), NUMBER.format("")],
    "link 'moved': mass: a value is not finite": [NUMBER.format("nan"), NUMBER.format("inf")],
    "link 'moved': <inertial> lacks <inertia>": [
        '<link name="moved"><inertial><mass value="1"/></inertial></link>'
    ],
    "link 'moved': <inertial> lacks <mass>": ['<link name="moved"><inertial/></link>'],
    "link 'moved': inertia: a value is missing or no number": [BODY.replace('ixy="0.001"', "")],
    "link that joint 'hinge' moves has no positive definite inertia": [
        BODY.replace('ixx="0.03"', 'ixx="-0.03"'),
        re.sub(r'(i[xyz]{2})="[^"]*"', r'\1="0"', BODY),
    ],
}
BAD_JOINTS = {
    "<limit> lacks lower, upper, velocity, effort": [hinge(""), hinge("", "prismatic")],
    "<limit> lacks lower, upper": [hinge('<limit velocity="1" effort="1"/>')],
    "<limit> lacks velocity": [hinge('<limit lower="-1" upper="1" effort="1"/>')],
    "<limit> lacks effort": [hinge('<limit lower="-1" upper="1" velocity="1"/>')],
    "lower limit 1 is not below the upper limit -1": [hinge(LIMIT.format(1, -1, 1))],
    "velocity limit 0 is not positive": [hinge(LIMIT.format(-1, 1, 0))],
    "a value is missing or no number": [hinge(LIMIT.format("x", 1, 1))],
    "type 'floating' is not supported": [hinge("", "floating")],
    "type 'screw' is not supported": [hinge("", "screw")],
    "the axis is zero": [hinge(GOOD, axis="0 0 0")],
    "it follows another one (<mimic>)": [hinge(f'{GOOD}<mimic joint="other"/>')],
}
BAD_ROBOTS = {
    "the robot has no joint that moves": [hinge("", "fixed")],
    "not a valid URDF model": [HINGE.replace('child link="moved"', 'child link="lost"'), HINGE + HINGE],
}
BAD_FILES = [
    (None, "no such URDF file"),
    ("joints of an arm", "not an XML file"),
    ("<sdf/>", "not a URDF file: its root is <sdf>, not <robot>"),
    ('<robot name="r"/>', "not a valid URDF model"),
    *((file(body=body), message) for message, bodies in BAD_BODIES.items() for body in bodies),
    *((file(hinge=bad), f"joint 'hinge': {message}") for message, all in BAD_JOINTS.items() for bad in all),
    *((file(hinge=bad), message) for message, every in BAD_ROBOTS.items() for bad in every),
]


@pytest.mark.parametrize(("content", "message"), BAD_FILES)
def test_bad_files_are_one_message(tmp_path, content, message):
    path = tmp_path / "arm.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_urdf(path)


def test_a_joint_is_locked_once_and_is_there(tmp_path):
    with pytest.raises(InputError, match="joint 'hinge' is to be locked twice"):
        read_urdf(write(tmp_path), ("hinge", "hinge"))
    with pytest.raises(InputError, match="there is no moving joint 'finger' to lock"):
        read_urdf(write(tmp_path), ("finger",))


def test_an_inertia_that_no_body_has_is_told_of(tmp_path):
    body = BODY.replace('ixx="0.03"', 'ixx="0.3"')
    with pytest.warns(UserWarning, match="no body has the inertia of what moves with 'hinge'"):
        read_urdf(write(tmp_path, body=body))


def test_a_log_is_brought_into_the_robot_s_order():
    tree = robot("panda").tree
    names = [*reversed(tree.names), *FINGERS]  # fingers are not the arm's
    log = np.arange(9)[None]
    np.testing.assert_array_equal(log[:, joint_order(tree, names, "log")], [[6, 5, 4, 3, 2, 1, 0]])


def test_a_log_of_another_robot_is_refused():
    tree = robot("panda").tree
    lacking = r"log\.mcap: the log lacks the robot's joints panda_joint6, panda_joint7"
    with pytest.raises(InputError, match=lacking):
        joint_order(tree, tree.names[:5], "log.mcap")
    with pytest.raises(InputError, match=r"log\.mcap: joint 'panda_joint2' stands 2 times"):
        joint_order(tree, [*tree.names, "panda_joint2"], "log.mcap")


def linked(path, joints):
    """Joints as (name, kind, parent, child)."""
    lines = [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for name, kind, parent, child in joints
    ]
    path.write_text(f"<robot name='r'>{''.join(lines)}</robot>")
    return path


def test_the_hand_of_a_panda_is_neither_a_finger_nor_a_link_before_it():
    panda = urdf_path("franka_panda/panda.urdf")
    assert moving_joints(panda) == ARM + list(FINGERS)
    assert tips(panda, ARM) == ["panda_grasptarget"]
    assert tips(panda, ARM + list(FINGERS)) == ["panda_grasptarget", "panda_leftfinger", "panda_rightfinger"]
    assert tips(panda, ARM[:3]) == ["panda_link3"]
    assert tips(panda, []) == []


def test_without_a_name_for_a_hand_it_is_the_link_behind_the_most_joints(tmp_path):
    joints = [
        ("a", "revolute", "base", "one"),
        ("b", "revolute", "one", "two"),
        ("c", "fixed", "base", "camera"),
        ("d", "revolute", "base", "wheel"),
    ]
    assert tips(linked(tmp_path / "robot.urdf", joints), "abd") == ["two", "wheel"]


def test_a_circle_of_links_ends(tmp_path):
    joints = [("a", "revolute", "one", "two"), ("b", "revolute", "two", "one")]
    assert tips(linked(tmp_path / "robot.urdf", joints), "ab") == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such URDF"),
        ("<robot", "not an XML file"),
        ("<robot/>", "no joints"),
        ("<robot><joint name='a'/></robot>", "'a' has no parent"),
    ],
)
def test_names_of_what_is_no_urdf_are_not_looked_for(tmp_path, content, message):
    path = tmp_path / "robot.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=message):
        moving_joints(path)


def test_joints_that_were_recorded_under_other_names_are_found_by_number_and_order():
    panda = urdf_path("franka_panda/panda.urdf")
    recorded = [f"fer_joint{number}" for number in (2, 1, 3, 4, 5, 6, 7)]  # messages name them in any order
    found = counterparts(panda, recorded)
    assert found == {f"fer_joint{number}": f"panda_joint{number}" for number in range(1, 8)}
    assert tips(panda, found.values()) == ["panda_grasptarget"]
    assert counterparts(panda, ["shoulder", "elbow", "wrist"]) == {}
    assert counterparts(panda, [f"fer_joint{number}" for number in range(2, 9)]) == {}
