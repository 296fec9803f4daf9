import re

import numpy as np
import pybullet_data
import pytest
from rigid_body_robots import FINGERS, joint, link, robot

from structlearn.ground.errors import InputError
from structlearn.rigid_body.tree import joint_order, read_urdf

BODY = link("moved")
HINGE = joint("hinge", "revolute", "base", "moved")


def write(folder, body=BODY, hinge=HINGE, more=""):
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm"><link name="base"/>{body}{hinge}{more}</robot>')
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


@pytest.mark.parametrize(
    ("message", "body"), [(message, body) for message, bodies in BAD_BODIES.items() for body in bodies]
)
def test_bad_inertias_are_one_message(tmp_path, message, body):
    path = write(tmp_path, body=body)
    with pytest.raises(InputError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_urdf(path)


def hinge(limit, kind="revolute", axis="0 0 1"):
    return joint("hinge", kind, "base", "moved", limit=limit, axis=axis)


BAD_JOINTS = {
    "joint 'hinge': <limit> lacks lower, upper, velocity, effort": [hinge(""), hinge("", "prismatic")],
    "joint 'hinge': <limit> lacks lower, upper": [hinge('<limit velocity="1" effort="1"/>')],
    "joint 'hinge': <limit> lacks velocity": [hinge('<limit lower="-1" upper="1" effort="1"/>')],
    "joint 'hinge': lower limit 1 is not below the upper limit -1": [
        hinge('<limit lower="1" upper="-1" velocity="1" effort="1"/>')
    ],
    "joint 'hinge': velocity limit 0 is not positive": [
        hinge('<limit lower="-1" upper="1" velocity="0" effort="1"/>')
    ],
    "joint 'hinge': a value is missing or no number": [
        hinge('<limit lower="x" upper="1" velocity="1" effort="1"/>')
    ],
    "joint 'hinge': <limit> lacks effort": [hinge('<limit lower="-1" upper="1" velocity="1"/>')],
    "joint 'hinge': type 'floating' is not supported": [hinge("", "floating")],
    "joint 'hinge': type 'planar' is not supported": [hinge("", "planar")],
    "joint 'hinge': type 'screw' is not supported": [hinge("", "screw")],
    "joint 'hinge': the axis is zero": [
        hinge('<limit lower="-1" upper="1" velocity="1" effort="1"/>', axis="0 0 0")
    ],
    "joint 'hinge': it follows another one (<mimic>)": [
        hinge('<limit lower="-1" upper="1" velocity="1" effort="1"/><mimic joint="other"/>')
    ],
    "the robot has no joint that moves": [hinge("", "fixed")],
    "not a valid URDF model": [HINGE.replace('child link="moved"', 'child link="lost"'), HINGE + HINGE],
}


@pytest.mark.parametrize(
    ("message", "hinge"), [(message, hinge) for message, hinges in BAD_JOINTS.items() for hinge in hinges]
)
def test_bad_joints_are_one_message(tmp_path, message, hinge):
    path = write(tmp_path, hinge=hinge)
    with pytest.raises(InputError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_urdf(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such URDF file"),
        ("joints of an arm", "not an XML file"),
        ("<sdf/>", "not a URDF file: its root is <sdf>, not <robot>"),
        ('<robot name="r"/>', "not a valid URDF model"),
    ],
)
def test_bad_files_are_one_message(tmp_path, content, message):
    path = tmp_path / "arm.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=re.escape(f"{path}: {message}")):
        read_urdf(path)


def test_a_joint_is_not_locked_twice(tmp_path):
    with pytest.raises(InputError, match="joint 'hinge' is to be locked twice"):
        read_urdf(write(tmp_path), ("hinge", "hinge"))


def test_an_inertia_that_no_body_has_is_told_of(tmp_path):
    body = BODY.replace('ixx="0.03"', 'ixx="0.3"')
    with pytest.warns(UserWarning, match="no body has the inertia of what moves with 'hinge'"):
        read_urdf(write(tmp_path, body=body))


def test_an_unknown_joint_cannot_be_locked():
    path = f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf"
    with pytest.raises(InputError, match=f"{path}: there is no moving joint '{FINGERS[0]}' to lock"):
        read_urdf(path, FINGERS)


def test_a_log_is_brought_into_the_robot_s_order():
    tree = robot("panda").tree
    names = [*reversed(tree.names), *FINGERS]  # fingers are not the arm's
    log = np.arange(9)[None]
    np.testing.assert_array_equal(log[:, joint_order(tree, names, "log")], [[6, 5, 4, 3, 2, 1, 0]])


def test_a_log_of_another_robot_is_refused():
    tree = robot("panda").tree
    with pytest.raises(
        InputError, match=r"log\.mcap: the log lacks the robot's joints panda_joint6, panda_joint7"
    ):
        joint_order(tree, tree.names[:5], "log.mcap")
    with pytest.raises(InputError, match=r"log\.mcap: joint 'panda_joint2' stands 2 times"):
        joint_order(tree, [*tree.names, "panda_joint2"], "log.mcap")
