"""Recordings of the dynamics testbed, on made-up results."""

import numpy as np
import pytest
from committed import committed
from dynamics_tables import IIWA, iiwa, payload_table, tracking_tables
from viewer_files import note, values, view_names

from dissertation.dynamics import recordings as views
from dissertation.dynamics.names import ROBOT
from dissertation.dynamics.protocol.tracking import tracked_reaches
from dissertation.dynamics.protocol.trainings import CHOSEN
from dissertation.dynamics.world.joint_logs import PayloadParameters
from dissertation.dynamics.world.operational_space import tool_motion
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.dynamics_models import DynamicsModels, rigid_body_torques
from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_names import DEFAULT
from structlearn.rigid_body.motion import Motion
from structlearn.viewer.arms import arm_scene, meshes
from structlearn.viewer.recording import Recording, write

TREE = iiwa().tree
TOOL_M = (0.0, 0.0, 0.1)
TITLE = "Dynamics: made up (simulated)"


def chosen(**changes):
    return committed(views.DynamicsViewParameters, "inspect_dynamics", **changes)


@pytest.fixture(scope="module")
def shown():
    scores, paths = tracking_tables()
    models = (DEFAULT, "mlp", "delan", "cov_coulomb", "never tracked")
    return tracked_reaches(paths, scores, ROBOT, CHOSEN, models, TREE.names)


@pytest.fixture(scope="module")
def reaches(shown, tmp_path_factory):
    path = tmp_path_factory.mktemp("dynamics") / "reaches.rrd"
    write(path, views.reaches(IIWA, TREE.names, shown, TITLE))
    return path


def test_a_reach_is_that_of_the_shown_seed(shown):
    assert [one.model for one in shown] == [DEFAULT, "mlp", "delan", "cov_coulomb"]
    first = shown[0]
    assert len(first.time) == 50
    # the made-up tool is off by 0.01 error m along each axis
    assert first.off_mm == pytest.approx(10.0 * 0.01 * np.sqrt(3.0))
    own, wanted = first.speeds
    assert own[0] == 0.0
    assert own == pytest.approx(wanted)
    assert wanted[1] == pytest.approx(np.sqrt(3.0) * 0.1 * np.sin(0.04) / 0.04)


def test_arms_stand_where_their_joints_say(shown, reaches):
    """The quaternion of the first joint's frame, which turns about z."""
    angles = shown[0].joints[:, 0]
    found = values(reaches, f"/arm_{DEFAULT}/frames/{TREE.names[0]}", "Transform3D:quaternion")
    found = np.array(found).reshape(-1, 4)
    assert np.abs(found[:, 2]) == pytest.approx(np.abs(np.sin(0.5 * angles)), abs=1e-5)


def test_plots_and_headings_say_who_was_stopped(shown, reaches):
    assert "DeLaN (stopped: speed limit)" in view_names(reaches)
    assert "Simulated" in note(reaches)
    off = np.ravel(values(reaches, "/off/mlp", "Scalars:scalars"))
    assert off == pytest.approx(shown[1].off_mm)
    wanted = np.ravel(values(reaches, "/speed/wanted", "Scalars:scalars"))
    assert wanted == pytest.approx(shown[0].speeds[1])


def test_torques_are_shown_per_joint_less_the_measured_ones(tmp_path):
    arm, time = iiwa(), np.arange(20) / 10.0
    q = np.column_stack([np.sin(time + joint) for joint in range(7)])
    motion = Motion(q, np.gradient(q, axis=0), np.zeros_like(q), np.cos(q))
    state = {
        "inertia": free_parameters("cov", arm.inertias)[None].numpy(),
        "friction": np.full((1, 7, 2), 0.5),
    }
    models = {"cov_coulomb": DynamicsModels("cov", TREE.names, ("viscous", "coulomb"), (), state)}
    path, kept = tmp_path / "torques.rrd", motion.part(slice(0, 15, 2))
    shown = chosen(torques_s=1.5, rate_hz=5.0)
    write(path, views.torques(IIWA, arm, motion, 0.1, models, TOOL_M, shown))
    joint = f"/torque/{TREE.names[4]}"
    learned, default = (
        np.ravel(values(path, f"{joint}/{name}", "Scalars:scalars")) for name in ("cov_coulomb", DEFAULT)
    )
    known = rigid_body_torques(arm.tree, arm.inertias, kept)
    assert default == pytest.approx((known - kept.torque)[:, 4])
    speed = kept.qd[:, 4]  # the same links, and friction on top
    assert learned - default == pytest.approx(0.25 * (speed + np.tanh(speed / 0.02)), abs=1e-4)
    assert "Simulated." in note(path)


def test_a_payload_appears_when_it_is_picked_up(tmp_path):
    stamps = (np.arange(0.0, 60.0, 0.5) * 1e9).astype(np.int64)
    still = np.zeros((len(stamps), 7))
    log = JointLog("payload", TREE.names, stamps, still, still, still, provenance={})
    carried = committed(PayloadParameters, "record_motion.payload")
    learned = payload_table().query("seed == 11")
    path = tmp_path / "payload.rrd"
    write(path, views.payload(IIWA, TREE, log, learned, carried, chosen(payload_s=10.1)))
    time = np.arange(20.0, 40.5, 0.5)
    points = np.array(values(path, "/payload", "Points3D:positions")).reshape(-1, 3)
    body, _ = tool_motion(TREE, carried.point_m, still[:1], still[:1])
    assert points == pytest.approx(np.tile(body, ((time >= 30.0).sum(), 1)), abs=1e-6)
    mass = np.ravel(values(path, "/mass/carried", "Scalars:scalars"))
    assert (mass == np.where(time >= 30.0, carried.mass_kg, 0.0)).all()
    shown = learned[learned["time_s"].between(20.0, 40.0)]["mass_kg"].to_numpy()
    assert np.ravel(values(path, "/mass/learned", "Scalars:scalars")) == pytest.approx(shown)
    assert "Simulated" in note(path)


def test_meshes_of_packages_are_found_beside_the_urdf_and_other_joints_stand_still(tmp_path):
    """A plate on a joint that moves and one on a joint that does not."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "plate.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    visual = '<visual><geometry><mesh filename="package://meshes/plate.obj"/></geometry></visual>'
    links = '<link name="base"/>' + "".join(f'<link name="{name}">{visual}</link>' for name in "ab")
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        for name, parent, child in (("moves", "base", "a"), ("rests", "a", "b"))
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="two">{links}{joints}</robot>')
    path = tmp_path / "arm.rrd"
    arm = meshes("one", tmp_path / "arm.urdf", ["moves"], np.arange(3.0), np.ones((3, 1)))
    write(path, Recording("Arm", arm_scene("arm", arm, np.ones((1, 3)))))
    assert values(path, "/one/two/visual_geometries/a/visual_0", "Asset3D:blob")
    assert len(values(path, "/one/frames/moves", "Transform3D:quaternion")) == 3
    assert len(values(path, "/one/frames/rests", "Transform3D:quaternion")) == 1
