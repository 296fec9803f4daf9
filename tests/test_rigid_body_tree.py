import re
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import pytest
import torch
from rigid_body_robots import FILES, FINGERS, ODD, joint, link, pinocchio_torques, robot, states
from rigid_body_robots import robot as known_robot

from structlearn.core.errors import InputError
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.dynamics_models import rigid_body_torques
from structlearn.rigid_body.inertia_parameters import link_inertias, sample_parameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.robot import Robot, read_urdf
from structlearn.rigid_body.tree import joint_order
from structlearn.rigid_body.urdf import (
    counterparts,
    moving_joints,
    require_velocities,
    tips,
    write_urdf,
)

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
    assert (tree.lower[at["endless"]], tree.upper[at["endless"]]) == (-np.inf, np.inf)
    assert (tree.lower[at["skewed"]], tree.upper[at["skewed"]]) == (-1.5, 2.0)
    assert (tree.velocity[at["skewed"]], tree.velocity[at["endless_skewed"]]) == (3.0, 2.0)


def test_links_at_fixed_and_locked_joints_belong_to_those_that_carry_them():
    assert robot("odd").inertias.mass[-1] == pytest.approx(0.4 + 0.5)
    assert len(robot("panda").tree.names) == 7
    assert len(robot("panda_hand").tree.names) == 9
    assert robot("panda").inertias.mass.sum() == pytest.approx(robot("panda_hand").inertias.mass.sum())


def test_a_massless_link_may_move_what_is_fixed_to_it(tmp_path):
    """As flanges in many URDFs."""
    more = link("tool", 0.8) + joint("bolt", "fixed", "moved", "tool")
    assert read_urdf(write(tmp_path, body='<link name="moved"/>', more=more)).inertias.mass == [0.8]


LIMIT = '<limit lower="{}" upper="{}" velocity="{}" effort="1"/>'
GOOD = LIMIT.format(-1, 1, 1)


def hinged(limit, kind="revolute", axis="0 0 1"):
    return file(hinge=joint("hinge", kind, "base", "moved", limit=limit, axis=axis))


def heavy(mass):
    return file(body=BODY.replace('mass value="1.0"', f'mass value="{mass}"'))


BAD_FILES = [
    (None, "no such URDF file"),
    ("joints of an arm", "not an XML file"),
    ("<sdf/>", "not a URDF file: its root is <sdf>, not <robot>"),
    ('<robot name="r"/>', "not a valid URDF model"),
    (file(body='<link name="moved"/>'), "link that joint 'hinge' moves has no mass: <inertial> is absent or"),
    (heavy(0), "link that joint 'hinge' moves has no mass: <inertial> is absent or zero"),
    (heavy(-2), "link 'moved': mass -2 kg is negative"),
    (heavy("heavy"), "link 'moved': inertial mass value='heavy' is not a finite number"),
    (heavy("nan"), "link 'moved': inertial mass value='nan' is not a finite number"),
    (file(body=BODY.replace(' value="1.0"', "")), "link 'moved': <mass> lacks value"),
    (file(body='<link name="moved"><inertial/></link>'), "link 'moved': <inertial> lacks <mass>"),
    (file(body=BODY.replace('ixy="0.001"', "")), "link 'moved': <inertia> lacks ixy"),
    (
        file(body=BODY.replace('ixx="0.03"', 'ixx="-0.03"')),
        "link that joint 'hinge' moves has no positive definite inertia",
    ),
    (hinged(""), "joint 'hinge': <limit> lacks lower, upper, velocity, effort"),
    (hinged('<limit lower="-1" upper="1" effort="1"/>', "prismatic"), "<limit> lacks velocity"),
    (hinged(LIMIT.format(1, -1, 1)), "joint 'hinge': lower limit 1 is not below the upper limit -1"),
    (hinged(LIMIT.format(-1, 1, -1)), "joint 'hinge': velocity limit -1 is negative"),
    (hinged(LIMIT.format("x", 1, 1)), "joint 'hinge': limit lower='x' is not a finite number"),
    (hinged(LIMIT.format(-170, 170, 1)), "joint 'hinge': limits -170 and 170 are in rad: degrees?"),
    (hinged("", "floating"), "joint 'hinge': type 'floating' is not supported"),
    (hinged(GOOD, axis="0 0 0"), "joint 'hinge': the axis is zero"),
    (hinged(f'{GOOD}<mimic joint="other"/>'), "joint 'hinge': it follows another one (<mimic>)"),
    (hinged("", "fixed"), "the robot has no joint that moves"),
    (file(hinge=HINGE.replace('child link="moved"', 'child link="lost"')), "not a valid URDF model"),
]


@pytest.mark.parametrize(("content", "message"), BAD_FILES)
def test_bad_files_are_one_message(tmp_path, content, message):
    path = tmp_path / "arm.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_urdf(path)


PLACED = BODY + link("tool", 1.2) + joint("bolt", "fixed", "moved", "tool", origin='xyz="0 0 1" rpy="0 0 0"')
# attribute as in the file, its element in messages, and how many numbers it has
NUMERIC = [
    ('rpy="0 0 0"', "origin rpy", 3),
    ('xyz="0 0 1"', "origin xyz", 3),
    ('xyz="0.05 -0.02 0.1"', "inertial origin xyz", 3),
    ('axis xyz="0 0 1"', "axis xyz", 3),
    ('value="1.2"', "inertial mass value", 1),
    ('ixy="0.001"', "inertial inertia ixy", 1),
    ('effort="50"', "limit effort", 1),
    ('velocity="3"', "limit velocity", 1),
    ('upper="2"', "limit upper", 1),
]


@pytest.mark.parametrize("text", ["", "1,57", "nan", "1e999", "${pi}", "1_0", "0x1", "1.0 kg"])
@pytest.mark.parametrize(("attribute", "where", "count"), NUMERIC)
def test_an_attribute_that_is_not_made_of_numbers_is_named(tmp_path, attribute, where, count, text):
    """Pinocchio drops such an inertial, and with it the mass of a tool."""
    name = attribute.partition("=")[0]
    bad, content = f"{text} 0 0" if count == 3 else text, file(body=PLACED)
    assert content.count(attribute) >= 1
    path = tmp_path / "arm.urdf"
    path.write_text(content.replace(attribute, f'{name}="{bad}"'))
    wanted = "3 finite numbers" if count == 3 else "a finite number"
    with pytest.raises(InputError, match=re.escape(f"{where}='{bad}' is not {wanted}")):
        read_urdf(path)


@pytest.mark.parametrize("blank", ["\t", "\n", "  "])
def test_numbers_may_be_separated_by_any_blanks(tmp_path, blank):
    body = link("moved", centre=blank.join(["0.05", "-0.02", "0.1"])).replace('"1.0"', f'"1.0{blank}"')
    inertias = read_urdf(write(tmp_path, body=body)).inertias
    np.testing.assert_allclose([inertias.mass[0], *inertias.first_moment[0]], [1.0, 0.05, -0.02, 0.1])


def test_what_dynamics_do_not_need_is_not_checked(tmp_path):
    """Undeclared prefixes in blocks for simulators, shapes, and limits of 0 for none."""
    shape = '<visual><origin xyz="0,1 0 0"/><geometry><box size="1"/></geometry></visual>'
    more = '<gazebo reference="moved"><sensor:camera name="rgb"/></gazebo>'
    hinge = joint("hinge", "revolute", "base", "moved", limit=LIMIT.format(-1, 1, 0).replace('"1"/', '"0"/'))
    path = write(tmp_path, body=BODY.replace("</link>", f"{shape}</link>"), hinge=hinge, more=more)
    robot, target = read_urdf(path), tmp_path / "identified.urdf"
    write_urdf(path, target, robot.tree, robot.inertias)
    np.testing.assert_allclose(read_urdf(target).inertias.mass, robot.inertias.mass)
    with pytest.raises(InputError, match="joint 'hinge': velocity limit 0 is not positive"):
        require_velocities(path, robot.tree)


def test_a_joint_is_locked_once_and_is_there(tmp_path):
    with pytest.raises(InputError, match="joint 'hinge' is to be locked twice"):
        read_urdf(write(tmp_path), ("hinge", "hinge"))
    with pytest.raises(InputError, match="there is no moving joint 'finger' to lock"):
        read_urdf(write(tmp_path), ("finger",))


def test_an_inertia_that_no_body_has_is_told_of(tmp_path):
    body = BODY.replace('ixx="0.03"', 'ixx="0.3"')
    with pytest.warns(UserWarning, match="no body has the inertia of what moves with 'hinge'"):
        read_urdf(write(tmp_path, body=body))


def test_a_log_is_brought_into_the_robots_order_and_that_of_another_robot_refused():
    tree = robot("panda").tree
    names = [*reversed(tree.names), *FINGERS]  # fingers are not the arm's
    assert joint_order(tree, names, "log").tolist() == [6, 5, 4, 3, 2, 1, 0]
    lacking = r"log\.mcap: the log lacks the robot's joints panda_joint6, panda_joint7"
    with pytest.raises(InputError, match=lacking):
        joint_order(tree, tree.names[:5], "log.mcap")
    with pytest.raises(InputError, match=r"log\.mcap: joint 'panda_joint2' stands 2 times"):
        joint_order(tree, [*tree.names, "panda_joint2"], "log.mcap")


def test_the_hand_of_a_panda_is_neither_a_finger_nor_a_link_before_it():
    panda = urdf_path("franka_panda/panda.urdf")
    assert moving_joints(panda) == ARM + list(FINGERS)
    assert tips(panda, ARM) == ["panda_grasptarget"]
    assert tips(panda, ARM + list(FINGERS)) == ["panda_grasptarget", "panda_leftfinger", "panda_rightfinger"]
    assert tips(panda, ARM[:3]) == ["panda_link3"]
    assert tips(panda, []) == []


@pytest.mark.parametrize(
    ("joints", "hands"),
    [
        (("a base one", "b one two", "c base camera", "d base wheel"), ["two", "wheel"]),
        (("a one two", "b two one"), []),  # a circle of links ends
    ],
)
def test_without_a_name_for_a_hand_it_is_the_link_behind_the_most_joints(tmp_path, joints, hands):
    parts = []
    for name, parent, child in map(str.split, joints):
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        parts.append(f'<joint name="{name}" type="{"fixed" if name == "c" else "revolute"}">{ends}</joint>')
    path = tmp_path / "robot.urdf"
    path.write_text(f"<robot name='r'>{''.join(parts)}</robot>")
    assert tips(path, "abd") == hands


@pytest.mark.parametrize(
    ("content", "message"),
    [("<robot/>", "no joints"), ("<robot><joint name='a'/></robot>", "'a' has no parent")],
)
def test_names_of_what_is_no_urdf_are_not_looked_for(tmp_path, content, message):
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        moving_joints(path)


def test_joints_that_were_recorded_under_other_names_are_found_by_number_and_order():
    panda = urdf_path("franka_panda/panda.urdf")
    recorded = [f"fer_joint{number}" for number in (2, 1, 3, 4, 5, 6, 7)]  # messages name them in any order
    found = counterparts(panda, recorded)
    assert found == {f"fer_joint{number}": f"panda_joint{number}" for number in range(1, 8)}
    assert tips(panda, found.values()) == ["panda_grasptarget"]
    assert counterparts(panda, ["shoulder", "elbow", "wrist"]) == counterparts(panda, recorded[:3]) == {}
    assert counterparts(panda, [f"fer_joint{number}" for number in range(2, 9)]) == {}


def source(name: str, folder: Path) -> Path:
    if name != "odd":
        return Path(pybullet_data.getDataPath()) / FILES[name]
    path = folder / "source.urdf"
    path.write_text(ODD)
    return path


def other_inertias(robot: Robot):
    """Physically consistent inertias that are not those of the source."""
    free = sample_parameters("cov", len(robot.tree.names), [torch.Generator().manual_seed(3)])
    return link_inertias("cov", free[0]).arrays()


@pytest.mark.parametrize("name", ["iiwa", "panda", "xarm", "odd"])
def test_torques_of_what_was_written_are_those_of_what_was_identified(name, tmp_path):
    robot, target = known_robot(name), tmp_path / "identified.urdf"
    inertias = other_inertias(robot)
    write_urdf(source(name, tmp_path), target, robot.tree, inertias)
    back = read_urdf(target)
    assert back.tree.names == robot.tree.names
    q, qd, qdd = states(robot, 20)
    expected = rigid_body_torques(robot.tree, inertias, Motion(q, qd, qdd, q))
    np.testing.assert_allclose(pinocchio_torques(back, q, qd, qdd), expected, rtol=0, atol=1e-10)


@pytest.fixture
def engine():
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    yield client
    pybullet.disconnect(client)


@pytest.mark.parametrize("name", ["panda", "xarm"])
def test_pybullet_has_the_same_torques_and_the_friction(name, tmp_path, engine):
    robot, target = known_robot(name), tmp_path / "identified.urdf"
    joints, inertias = len(robot.tree.names), other_inertias(robot)
    viscous, coulomb = 0.1 + np.arange(joints), 0.5 * np.arange(joints)
    write_urdf(source(name, tmp_path), target, robot.tree, inertias, viscous, coulomb)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(str(target), useFixedBase=True, flags=flags, physicsClientId=engine)
    numbers = range(pybullet.getNumJoints(body, engine))
    found = [pybullet.getJointInfo(body, joint, engine) for joint in numbers]
    moving = [one for one in found if one[2] != pybullet.JOINT_FIXED]
    assert [one[1].decode() for one in moving] == list(robot.tree.names)
    np.testing.assert_allclose([one[6:8] for one in moving], np.stack([viscous, coulomb], axis=1))
    q, qd, qdd = states(robot, 5)
    expected = rigid_body_torques(robot.tree, inertias, Motion(q, qd, qdd, q))
    for row, its in enumerate(expected):
        rows = [values[row].tolist() for values in (q, qd, qdd)]
        torques = pybullet.calculateInverseDynamics(body, *rows, physicsClientId=engine)
        np.testing.assert_allclose(torques, its, rtol=1e-5, atol=1e-4 * np.abs(expected).max())


def test_another_robots_source_is_refused(tmp_path):
    robot = known_robot("iiwa")
    with pytest.raises(InputError, match="lacks the joints lbr_iiwa_joint_1"):
        write_urdf(source("panda", tmp_path), tmp_path / "a.urdf", robot.tree, robot.inertias)


def test_a_chain_that_ends_in_a_circle_of_links_has_an_end(tmp_path):
    links = ("a1", "revolute", "one", "two"), ("f", "fixed", "three", "one"), ("g", "fixed", "one", "three")
    joints = [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for name, kind, parent, child in links
    ]
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="arm">{"".join(joints)}</robot>')
    assert counterparts(path, ["b1"]) == {"b1": "a1"}
