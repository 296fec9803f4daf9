"""Parts of the torque of a simulated planar arm: its reader, the fit of unknown lengths, and the protocol."""

import numpy as np
import pandas as pd
import pytest
from committed import committed_entry
from readers_bags import recorded_data

from dissertation.recorded.parts.learning import characters_left_out, learn_parts
from dissertation.recorded.parts.page import parts_section
from dissertation.recorded.parts.parameters import AUTHORS, RANDOM
from dissertation.recorded.readers import delan_characters
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.joint_log import PartedLog, read_log_table, write_log_table
from structlearn.rigid_body.dynamics_models import predicted_torques, rigid_body_torques, torque_parts
from structlearn.rigid_body.identification import fit_planar_arm, planar_tree
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import LinkInertias

PLACES = np.array([[0.6, -0.2]])
BODIES = LinkInertias(
    np.array([2.0, 1.0]),
    np.array([[0.5, 0.1, 0.0], [0.2, -0.1, 0.0]]),
    np.tile(np.diag([0.05, 0.06, 0.07]), (2, 1, 1)),
)


def motion(seed, samples=60):
    q, qd, qdd = np.random.default_rng(seed).normal(size=(3, samples, 2))
    still = Motion(q, qd, qdd, np.zeros_like(q))
    return Motion(q, qd, qdd, rigid_body_torques(planar_tree(PLACES), BODIES, still))


def log(name, seed):
    its = motion(seed)
    gravity = rigid_body_torques(planar_tree(PLACES), BODIES, Motion(its.q, *np.zeros((3, *its.q.shape))))
    slow = rigid_body_torques(planar_tree(PLACES), BODIES, Motion(its.q, 0 * its.qd, its.qdd, its.torque))
    parts = (slow - gravity, its.torque - slow, gravity)
    return PartedLog(name, ("a", "b"), np.arange(60), its.q, its.qd, its.torque, its.qdd, *parts)


def test_lengths_and_torques_of_an_arm_are_found_from_its_motion():
    tree, model = fit_planar_arm(motion(0), 300)
    np.testing.assert_allclose(tree.translation[1], [0.6, -0.2, 0.0], atol=1e-6)
    new = motion(1)
    np.testing.assert_allclose(predicted_torques(model, tree, new)[0], new.torque, atol=1e-3)
    inertial, coriolis, gravity = torque_parts(model, tree, new).values()
    np.testing.assert_allclose((inertial + coriolis + gravity)[0], predicted_torques(model, tree, new)[0])
    assert np.linalg.eigvalsh(model.inertias().inertia).min() > 0.0


def test_every_model_is_scored_on_what_it_did_not_see():
    quick = {"left_out": ("p",), "seeds": 2, "splits": 3, "epochs": 2, "batch": 64}
    quick |= {"hidden": {"mlp": (4,), "delan": (4,)}}
    quick["published"] = dict.fromkeys(("torque", "coriolis", "inertial", "gravity", "power"), 1e-3)
    parameters = committed_entry("delan_characters", **quick)
    logs = {name: log(name, seed) for seed, name in enumerate("pqr")}
    choices = characters_left_out(list(logs), parameters)
    assert [its[0] for its in choices] == [AUTHORS] * 2 + [RANDOM] * 3
    tables = learn_parts(logs, parameters)
    parts = tables["parts"]
    assert len(parts) == 5 * (5 + 5 + 4)
    assert parts[parts["model"] == "cov"]["error"].max() < 1e-6  # its torques are those of such an arm
    assert parts[parts["model"] == "delan"]["error"].min() > 1e-3
    np.testing.assert_allclose(tables["planar"]["length_m"], np.hypot(0.6, 0.2), atol=1e-6)
    find = parts_section(tables, parameters, {"source": "somewhere"}).find
    torque = parts.query("model == 'delan' and protocol == @AUTHORS and measure == 'torque'")["error"]
    assert find["delan_authors"]["torque"].value == pytest.approx(1e3 * torque.mean())
    with pytest.raises(InputError, match="logs to leave out are p"):
        learn_parts({"q": logs["q"]}, parameters)


def test_characters_are_read_with_their_parts_and_faults_are_named(tmp_path):
    with pytest.raises(MissingInputError, match=r"holds no characters\.npz"):
        delan_characters.read_parts(tmp_path)
    whole = {f"b/{name}": np.full((3, 2), 1.0) for name in delan_characters.ARRAYS.values()}
    np.savez(tmp_path / "characters.npz", **whole, **{"b/t": np.array([0.0, 0.04, 0.08])})
    (one,) = delan_characters.read_parts(tmp_path)
    assert (one.name, one.provenance["origin"]) == ("b", "simulated")
    write_log_table([one], tmp_path / "logs.parquet")
    (again,) = read_log_table(tmp_path / "logs.parquet", PartedLog)
    np.testing.assert_array_equal(again.coriolis, one.coriolis)
    np.savez(tmp_path / "characters.npz", **whole)
    with pytest.raises(InputError, match=r"characters\.npz: has no array b/t"):
        delan_characters.read_parts(tmp_path)


def test_the_published_torques_are_the_sum_of_their_parts():
    logs = delan_characters.read_parts(recorded_data("delan_characters"))
    assert len(logs) == 20
    for one in logs:
        np.testing.assert_allclose(one.inertial + one.coriolis + one.gravity, one.torques, atol=1e-12)
    assert pd.Series([len(one.stamps) for one in logs]).between(80, 200).all()
