import numpy as np
import pytest
from dynamics_tables import IIWA, iiwa, payload_table, tracking_tables
from rerun.chunk import RrdReader
from test_viewer import contents, view_names

from structlearn.rigid_body.inertia_parameters import free_parameters
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.testbeds.dynamics.recordings.payload import write_payload
from structlearn.testbeds.dynamics.recordings.reaches_recording import write_reaches
from structlearn.testbeds.dynamics.recordings.shown_motions import (
    ShownPayload,
    colour,
    reaching,
    shown_torques,
)
from structlearn.testbeds.dynamics.recordings.torques import write_torques
from structlearn.viewer.arm_meshes import send_arm
from structlearn.viewer.rrd import recording, time_column

TREE = iiwa().tree
TOOL_M = (0.0, 0.0, 0.1)


def values(path, entity, component):
    """Values of a component of an entity in the order of time, static ones first."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return [value for value in found if value is not None]


def text(path):
    ((found,),) = values(path, "/notes", "TextDocument:text")
    return found


@pytest.fixture(scope="module")
def shown():
    scores, paths = tracking_tables()
    models = (DEFAULT, "mlp", "delan", "cov_coulomb", "never tracked")
    return reaching(paths, scores, "stand_in", models, TREE.names)


@pytest.fixture(scope="module")
def reaches(shown, tmp_path_factory):
    path = tmp_path_factory.mktemp("dynamics") / "reaches.rrd"
    write_reaches(path, IIWA, TREE.names, shown, "Reaches")
    return path


def motion():
    time = np.arange(20) / 10.0
    q = np.column_stack([np.sin(time + joint) for joint in range(7)])
    return Motion(q, np.gradient(q, axis=0), np.zeros_like(q), np.cos(q))


def test_a_reach_is_that_of_the_first_seed(shown):
    """Seeds stand one behind the other in the table of paths."""
    assert [one.model for one in shown] == [DEFAULT, "mlp", "delan", "cov_coulomb"]
    first = shown[0]
    assert np.all(np.diff(first.time) > 0.0)
    assert len(first.time) == 50
    # the made-up tool is off by 0.01 (error + seed) m along each axis
    assert first.off_mm == pytest.approx(10.0 * 0.01 * np.sqrt(3.0))
    own, wanted = first.speeds
    assert own[0] == 0.0
    assert own == pytest.approx(wanted)
    assert wanted[1] == pytest.approx(np.sqrt(3.0) * 0.1 * np.sin(0.04) / 0.04)


def test_every_model_has_an_arm_of_its_own(shown, reaches):
    moving, still, _ = contents(reaches)
    for one in shown:
        assert f"/arm_{one.model}/frames/{TREE.names[3]}" in moving
        assert f"/arm_{one.model}/lbr_iiwa/visual_geometries/lbr_iiwa_link_3/visual_0" in still
        frames = values(reaches, f"/arm_{one.model}/frames/{TREE.names[3]}", "Transform3D:child_frame")
        assert len(frames) == len(one.time)
        assert frames[0] == [f"arm_{one.model}/lbr_iiwa_link_4"]


def test_arms_stand_where_their_joints_say(shown, reaches):
    """The quaternion of the first joint's frame, which turns about z."""
    angles = shown[0].joints[:, 0]
    found = values(reaches, f"/arm_{DEFAULT}/frames/{TREE.names[0]}", "Transform3D:quaternion")
    found = np.array(found).reshape(-1, 4)
    assert np.abs(found[:, 2]) == pytest.approx(np.abs(np.sin(0.5 * angles)), abs=1e-5)


def test_plots_and_headings_say_who_was_stopped(shown, reaches):
    assert "DeLaN (stopped: speed limit)" in view_names(reaches)
    assert "| DeLaN |  | speed limit |" in text(reaches)
    assert "| MLP | 5.0000 |  |" in text(reaches)
    off = np.ravel(values(reaches, "/off/mlp", "Scalars:scalars"))
    assert off == pytest.approx(shown[1].off_mm)
    wanted = np.ravel(values(reaches, "/speed/wanted", "Scalars:scalars"))
    assert wanted == pytest.approx(shown[0].speeds[1])


def test_torques_are_shown_per_joint_beside_the_measured_ones(tmp_path):
    arm, its = iiwa(), motion()
    state = {
        "inertia": free_parameters("cov", arm.inertias)[None].numpy(),
        "friction": np.full((1, 7, 2), 0.5),
    }
    models = {"cov_coulomb": DynamicsModels("cov", TREE.names, ("viscous", "coulomb"), (), state)}
    torques = shown_torques(arm, its, 0.1, models, TOOL_M)
    # the same links, and friction on top
    extra = torques.predicted["cov_coulomb"] - torques.predicted[DEFAULT]
    assert extra == pytest.approx(0.25 * (its.qd + np.tanh(its.qd / 0.02)), abs=1e-4)
    assert torques.tool == pytest.approx(tool_motion(TREE, TOOL_M, its.q, its.qd)[0])
    path = tmp_path / "torques.rrd"
    write_torques(path, IIWA, torques, "Torques")
    joint = TREE.names[4]
    assert np.ravel(values(path, f"/torque/{joint}/measured", "Scalars:scalars")) == pytest.approx(
        its.torque[:, 4]
    )
    assert f"/torque/{joint}/{DEFAULT}" in contents(path)[0]
    assert "| blue | Cov + Coulomb |" in text(path)
    assert any(name.startswith(f"{joint} (N m); best:") for name in view_names(path))


def test_a_payload_appears_when_it_is_picked_up(tmp_path):
    time = np.arange(110.0, 130.0, 0.5)
    body = np.column_stack([0.5 + 0.01 * time, 0.0 * time, 0.6 + 0.0 * time])
    learned = payload_table().query("110 <= time_s <= 130")
    one = ShownPayload(TREE.names, time, np.zeros((len(time), 7)), body, 120.0, 1.5, learned)
    path = tmp_path / "payload.rrd"
    write_payload(path, IIWA, one, "Payload")
    points = np.array(values(path, "/payload", "Points3D:positions")).reshape(-1, 3)
    assert points == pytest.approx(body[time >= 120.0], abs=1e-6)
    carried = np.ravel(values(path, "/mass/carried", "Scalars:scalars"))
    assert (carried == np.where(time >= 120.0, 1.5, 0.0)).all()
    mass = np.ravel(values(path, "/mass/learned", "Scalars:scalars"))
    assert mass == pytest.approx(learned["mass_kg"].to_numpy())


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
    with recording(path, "Arm") as stream:
        send_arm(
            stream, "one", tmp_path / "arm.urdf", ["moves"], time_column(np.arange(3.0)), np.ones((3, 1))
        )
    assert values(path, "/one/two/visual_geometries/a/visual_0", "Asset3D:blob")
    assert len(values(path, "/one/frames/moves", "Transform3D:quaternion")) == 3
    assert len(values(path, "/one/frames/rests", "Transform3D:quaternion")) == 1


def test_structures_share_a_colour_but_for_coulomb_friction():
    assert colour("spd") == colour("cov") != colour("cov_coulomb")
    assert len({colour(name) for name in (GROUND_TRUTH, DEFAULT, "mlp", "delan", "cov", "cov_coulomb")}) == 6
