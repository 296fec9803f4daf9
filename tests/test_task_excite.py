"""`structlearn excite`: a trajectory for a robot that nothing was recorded of."""

import numpy as np
import pandas as pd
import pytest
from committed import ROOT, own_tasks, read_yaml
from rigid_body_arms import planar_arm
from test_rigid_body_excitation import two_joints

from structlearn import command
from structlearn.core.errors import InputError
from structlearn.rigid_body.arm_kinematics import read_arm, read_collision_shapes
from structlearn.tasks.motion import excite


@pytest.fixture
def few(monkeypatch):
    """Parameters of a quick search."""
    whole = excite.stage_parameters("excite", excite.ExciteParameters, excite.project.DEFAULTS)
    changed = {"harmonics": 2, "period_s": 4.0, "starts": 1, "iterations": 10, "compared": 5, "draws": 20}
    parameters = whole.model_copy(update=changed)
    monkeypatch.setattr(excite, "stage_parameters", lambda *_: parameters)
    return parameters


def test_a_urdf_becomes_a_trajectory_with_a_page(tmp_path, monkeypatch, few, capsys):
    its = two_joints(tmp_path)
    monkeypatch.chdir(tmp_path)
    command.main(["excite", "--urdf", str(tmp_path / "two.urdf")])
    folder = tmp_path / "reports/excitation/two"
    path = pd.read_csv(folder / "trajectory.csv")
    assert path.shape[1] == 1 + 3 * 2
    assert np.all(path["position_elbow"].between(its.tree.lower[1], its.tree.upper[1]))
    assert set(pd.read_csv(folder / "tables/joints.csv")["kept"]) == {"yes"}
    assert pd.read_csv(folder / "tables/gains.csv")["gain"].median() > 1.0
    assert "not checked for collisions" in (folder / "index.html").read_text()
    assert "times smaller" in capsys.readouterr().out


def test_amplitudes_shrink_until_links_keep_their_distance(tmp_path, monkeypatch, few):
    its = two_joints(tmp_path)
    path = tmp_path / "planar.urdf"
    path.write_text(planar_arm(0.3, 0.3, 0.3))
    free = excite.random_series(its, 1, 0)[0]
    assert excite.clear(its, free, None, few) is free
    shapes = read_collision_shapes(read_arm(path, "tip"), (), np.zeros(3))
    distances = iter([0.0, 0.01, 0.5])
    monkeypatch.setattr(excite, "least_distance", lambda *_: next(distances))
    smaller = excite.clear(its, free, shapes, few)
    size = 1.0 / (1.0 + np.exp(-np.stack([free, smaller])[..., -1]))
    np.testing.assert_allclose(size[1], size[0] * excite.SHRINKS[2])


def test_a_task_that_names_no_robot_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    entries = read_yaml(ROOT / "examples/pick.yaml")["movement"]
    own_tasks(
        tmp_path, **entries, reaches={name: one for name, one in entries["pick"].items() if name != "robot"}
    )
    with pytest.raises(InputError, match="reaches: names no robot"):
        excite.task_urdf("reaches")
    assert excite.task_urdf("pick")[0] == "franka_panda/panda.urdf"
