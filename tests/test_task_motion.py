"""Logs of an arm of one's own: a made-up arm of three joints, known by what its URDF does not say."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from committed import TASK_FILE
from pydantic import ValidationError
from rigid_body_robots import joint, link

from dissertation.simulation.arm import Payload, carrying
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.base_parameters import base_parameters
from structlearn.rigid_body.dynamics_models import (
    predicted_torques,
    read_dynamics_models,
    rigid_body_torques,
)
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.model_comparison import TRAIN
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.robot import Robot, read_urdf
from structlearn.rigid_body.tree import LinkInertias
from structlearn.tasks.motion.differing_motion import (
    ALL,
    INERTIA,
    REFITTED,
    REPEATABILITY,
    DifferingMotion,
    differing_errors,
)
from structlearn.tasks.motion.differing_motion import LEARNED as LOST
from structlearn.tasks.motion.learning import learn_motion
from structlearn.tasks.motion.motion_figures import torque_check_panels
from structlearn.tasks.motion.parameters import LARGEST_CONDITION, MotionParameters
from structlearn.tasks.motion.repeated_motion import repeat_lines, repeats


def parameters(**changes) -> MotionParameters:
    """The defaults for a task's logs, quicker."""
    defaults = yaml.load(TASK_FILE.read_text(), yaml.CSafeLoader)["defaults"]["motion"]
    quick = {"source": "logs", "urdf": "arm.urdf", "rate_hz": 50.0, "smoothing_hz": 20.0, "rest_rad_s": 0.01}
    quick |= {"draws": 100, "iterations": 200, "gravity_n_m": 0.2}
    return MotionParameters.model_validate(defaults | quick | changes)


JOINTS = ("turn", "lift", "bend")
ARM = "\n".join(
    [
        '<robot name="arm"><link name="base"/>',
        *(link(name, mass) for name, mass in zip("abc", (3.0, 2.0, 1.0), strict=True)),
        joint("turn", "revolute", "base", "a", "0 0 1", 'xyz="0 0 0.2"'),
        joint("lift", "revolute", "a", "b", "0 1 0", 'xyz="0 0.05 0.2"'),
        joint("bend", "revolute", "b", "c", "0 1 0", 'xyz="0.3 0 0"'),
        "</robot>",
    ]
)
FRICTION = np.array([[0.3, 0.5], [0.4, 0.3], [0.2, 0.2]])
"""Viscous and Coulomb, by joint."""


def heavier(inertias: LinkInertias) -> LinkInertias:
    """What really moves: links a third heavier than the URDF says, and larger."""
    return LinkInertias(1.3 * inertias.mass, 1.4 * inertias.first_moment, 1.5 * inertias.inertia)


def made_up_log(robot: Robot, name: str, seed: int, seconds: float = 24.0, load_kg: float = 0.0) -> JointLog:
    """Sines on every joint, at a rest before; joints stand in another order than in the URDF.

    A load is a point at (0.2, 0, 0.1) m on the last link.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.01)
    after = np.clip(time - 1.5, 0.0, None)[:, None, None]
    rates, sizes, phases = 2.0 + 3.0 * rng.random((3, 3)), 0.3 * rng.random((3, 3)), 6.0 * rng.random((3, 3))
    q = minimum_jerk(np.minimum(after[..., 0] / 2.0, 1.0)) * (sizes * np.sin(rates * after + phases)).sum(
        axis=-1
    )
    qd = np.gradient(q, time, axis=0)
    motion = Motion(q, qd, np.gradient(qd, time, axis=0), np.zeros_like(q))
    loaded = carrying(heavier(robot.inertias), Payload(load_kg, (0.2, 0.0, 0.1), 0.0))
    torque = rigid_body_torques(robot.tree, loaded, motion)
    torque = torque + np.einsum("njt,jt->nj", friction_columns(q, qd, ("viscous", "coulomb")), FRICTION)
    torque += 0.02 * rng.standard_normal(torque.shape)
    stamps = (10**9 + np.round(1e9 * time)).astype(np.int64)
    names = ("gripper", *JOINTS[::-1])
    return JointLog(name, names, stamps, *(np.hstack([q[:, :1], its[:, ::-1]]) for its in (q, qd, torque)))


@lru_cache
def arm() -> tuple[Robot, str]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(ARM)
        return read_urdf(path), ARM


def identified(folder: Path, logs: list[JointLog], **changes) -> SimpleNamespace:
    """Tables by name."""
    source = folder / "arm.urdf"
    source.write_text(ARM)
    named = {log.name: log for log in logs}
    return SimpleNamespace(**learn_motion(arm()[0], named, parameters(**changes), source, folder)[1])


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """Three logs, the last of which is tested on."""
    folder = tmp_path_factory.mktemp("several")
    logs = [made_up_log(arm()[0], f"log {seed}", seed) for seed in range(3)]
    return identified(folder, logs), folder


def test_what_moves_is_found_and_predicts_the_last_log(several):
    results, _ = several
    errors = results.errors.query("part == 'test'").set_index(["model", "friction", "joint"]).sort_index()
    assert set(results.errors["joint"]) == {1, 2, 3}
    assert errors.loc["cov", "coulomb"]["nmse"].max() < 0.01
    assert errors.loc["urdf", "none"]["nmse"].min() > 0.05
    assert errors.loc["cov", "viscous"]["nmse"].max() > 2.0 * errors.loc["cov", "coulomb"]["nmse"].max()
    rows = results.motions.set_index("log")
    assert rows.loc["log 2", "learned_s"] == 0.0
    assert rows.loc["log 2", "tested_s"] == pytest.approx(22.3, abs=0.5)  # without the rest before
    found = results.bodies.pivot_table(index="link", columns="parameter", values="value").loc[list(JOINTS)]
    np.testing.assert_allclose(found[["viscous", "coulomb"]], FRICTION, atol=0.05)


def test_base_parameters_come_with_intervals_that_hold_the_truth(several):
    results, _ = several
    robot = arm()[0]
    true = base_parameters(robot.tree).values(heavier(robot.inertias))
    assert results.excitation["condition"][0] < LARGEST_CONDITION
    assert np.abs(results.base["value"] - true).max() < 0.05
    inside = (results.base["low"] - 0.02 <= true) & (true <= results.base["high"] + 0.02)
    assert inside.all()


def test_the_written_urdf_holds_what_was_found(several):
    results, folder = several
    assert results.written["difference_n_m"].max() < 1e-9
    again = read_urdf(folder / "identified.urdf")
    base = base_parameters(again.tree)
    true = base.values(heavier(arm()[0].inertias))
    assert np.abs(base.values(again.inertias) - true).max() < 0.1


def test_impossible_efforts_change_nothing_but_a_remark(several, tmp_path):
    """Three samples of 1e6 N m on an arm whose URDF says 50 would decide the whole fit."""
    logs = [made_up_log(arm()[0], f"log {seed}", seed) for seed in range(3)]
    torques = logs[1].torques.copy()
    torques[[500, 900, 1500], logs[1].joints.index("lift")] = 1e6
    results = identified(tmp_path, [logs[0], replace(logs[1], torques=torques), logs[2]])
    (text,) = results.impossible["text"]
    assert text == (
        "log 1: row 500 (stamp 6.000000000 s): effort of joint 'lift' is 1e+06 N m, more than 2 times the "
        "URDF's limit of 50 N m (and 2 more)"
    )
    keys = ["model", "friction", "part", "joint"]
    clean, found = (one.errors.set_index(keys)["nmse"].sort_index() for one in (several[0], results))
    np.testing.assert_allclose(found, clean, rtol=0.05, atol=1e-4)
    assert not hasattr(several[0], "impossible")
    nearly_all = replace(logs[1], torques=1e3 * logs[1].torques)
    with pytest.raises(
        InputError, match=r"log 1: row \d+ .* % may be left out: is it in N m, and is the limit"
    ):
        identified(tmp_path, [logs[0], nearly_all])


def test_gravity_that_the_driver_takes_out_is_told(several, tmp_path):
    results, _ = several
    holds = results.gravity.set_index("name")["holds"]
    assert holds["turn"] == "not tested"
    assert holds["lift"] == holds["bend"] == "yes"
    robot = arm()[0]
    log = made_up_log(robot, "lone", 5)
    still = Motion(log.positions[:, :0:-1], *np.zeros((3, len(log.stamps), 3)))
    gravity = rigid_body_torques(robot.tree, heavier(robot.inertias), still)
    without = log.torques.copy()
    without[:, :0:-1] -= gravity
    found = identified(tmp_path, [replace(log, torques=without)]).gravity.set_index("name")["holds"]
    assert found["lift"] == "no"
    turned = identified(tmp_path, [replace(log, torques=-log.torques)]).gravity.set_index("name")
    assert turned.loc["lift", "share"] < -0.7


def test_of_a_single_log_every_fourth_block_is_held_out_and_little_motion_is_told(tmp_path):
    log = made_up_log(arm()[0], "lone", 5)
    results = identified(tmp_path, [log])
    row = results.motions.iloc[0]
    moving = row["end_s"] - row["start_s"]
    assert row["tested_s"] == pytest.approx(0.25 * moving, abs=2.0)
    assert row["tested_s"] + row["learned_s"] == pytest.approx(moving)
    errors = results.errors.query("part == 'test' and model == 'cov' and friction == 'coulomb'")
    assert errors["nmse"].max() < 0.02
    less = np.array([0.01, 0.01, 1.0, 0.01])  # the gripper, then bend, lift and turn
    small = replace(log, positions=log.positions * less, velocities=log.velocities * less)
    assert identified(tmp_path, [small]).excitation["condition"][0] > LARGEST_CONDITION


def test_a_test_motion_that_repeats_the_training_motion_is_found(several, tmp_path):
    fresh = several[0].repeats
    assert not fresh["repeated"].any()
    assert fresh["difference"].min() > 1.0
    assert repeat_lines(fresh) == []
    log, late = made_up_log(arm()[0], "first", 5), made_up_log(arm()[0], "second", 5, seconds=20.0)
    found = identified(tmp_path, [log, replace(late, positions=late.positions + 0.001)]).repeats
    assert found[["log", "trained_on", "repeated"]].to_numpy().tolist() == [["second", "first", True]]
    assert found["lag_s"].item() == pytest.approx(0.0, abs=0.1)
    assert found["difference"].item() < 0.02
    (line,) = repeat_lines(found)
    assert line.startswith("Warning: the test motion of second repeats the training motion of first (")


def test_a_repetition_is_found_at_its_lag_and_neighbours_are_none():
    time = np.arange(0.0, 24.0, 0.02)[:, None]
    phases, slow = np.array([0.0, 1.0, 2.0]), 2.0 * np.pi / 30.0
    once = np.sin(2.0 * np.pi * time / 12.0 + phases) + np.sin(2.0 * np.pi * time / 4.0 - phases)
    for q, expected in ((once, True), (np.sin(slow * time + phases), False)):
        motion = Motion(q, q, q, q)
        pieces = {
            TRAIN: [("log", motion.part(slice(0, 900)))],
            "test": [("log", motion.part(slice(900, None)))],
        }
        row = repeats(pieces, 50.0).iloc[0]
        assert row["repeated"] == expected
        if expected:
            assert row["lag_s"] == pytest.approx(6.0)  # of 18 s after the start, 12 s before
            assert row["difference"] == pytest.approx(0.0, abs=1e-6)


def test_a_test_motion_that_repeats_the_training_motion_is_halved(several, tmp_path):
    """Then a model of the first half alone meets other motion, and the repetition gives the floor."""
    whole = several[0].differing.pivot_table("rmse_n_m", "joint", "fitted")
    assert not several[0].differing["halved"].any()
    assert REPEATABILITY not in whole
    log, late = made_up_log(arm()[0], "first", 5), made_up_log(arm()[0], "second", 5, seconds=20.0)
    rng = np.random.default_rng(0)
    rough = [
        replace(its, torques=its.torques + 0.1 * rng.standard_normal(its.torques.shape))
        for its in (log, late)
    ]
    found = identified(tmp_path, rough).differing
    assert found["halved"].all()
    assert found["learned_s"][0] == found["tested_s"][0] == pytest.approx(9.0, abs=0.5)
    errors = found.pivot_table("rmse_n_m", "joint", "fitted")
    np.testing.assert_allclose(errors[REPEATABILITY], errors[ALL], rtol=0.3)
    assert (errors[ALL] <= 1.01 * errors[LOST]).all()


@pytest.mark.parametrize("changed", [*REFITTED])
def test_the_term_that_changed_accounts_for_the_loss(several, changed):
    """Torques of a known model and of one change, in joint 2 or of a load."""
    tree, model = arm()[0].tree, read_dynamics_models(several[1] / "models/cov_coulomb.safetensors")
    log = made_up_log(arm()[0], "other", 7)
    q, qd = (values[:, :0:-1] for values in (log.positions, log.velocities))
    motion = Motion(q, qd, np.gradient(qd, 0.01, axis=0), np.zeros_like(q))
    if changed == INERTIA:
        bodies = arm()[0].inertias, carrying(arm()[0].inertias, Payload(0.5, (0.2, 0.0, 0.1), 0.0))
        empty, loaded = (rigid_body_torques(tree, its, motion) for its in bodies)
        change = loaded - empty
    else:
        change = friction_columns(q, qd, REFITTED[changed]).sum(axis=-1) * [0.0, 1.0, 0.0]
    torque = predicted_torques(model, tree, motion)[0]
    torque += 0.01 * np.random.default_rng(0).standard_normal(q.shape)
    test, again = replace(motion, torque=torque + change), replace(motion, torque=torque + change - 0.5)
    errors = differing_errors(tree, model, DifferingMotion(None, test, again)).pivot_table(
        "rmse_n_m", "joint", "fitted"
    )
    np.testing.assert_allclose(errors[REPEATABILITY], 0.5 / np.sqrt(2.0))
    assert errors[changed].max() < 0.011
    others = [
        name for name in (LOST, *REFITTED) if name not in (changed, INERTIA)
    ]  # it may stand in for them
    assert errors[others].max().min() > 0.05


def test_a_log_that_is_too_short_or_lacks_a_joint_is_refused(tmp_path):
    log = made_up_log(arm()[0], "short", 0, seconds=3.0)
    with pytest.raises(InputError, match=r"^short: .* are too short for blocks of 2 s$"):
        identified(tmp_path, [log])
    with pytest.raises(InputError, match=r"short: the log lacks the robot's joints bend"):
        identified(tmp_path, [replace(log, joints=("gripper", "other", "lift", "turn"))])


def test_a_load_of_known_weight_is_weighed_with_torques_too(tmp_path):
    """What the public UR10e has is an option: named logs, networks, a load; here without motor currents."""
    logs = [made_up_log(arm()[0], name, 3, load_kg=load) for name, load in (("a", 0.0), ("aLoad", 0.8))]
    logs += [made_up_log(arm()[0], "b", 4)]
    load = {"pairs": [], "known_kg": 0.8, "structure": "cov", "batch": 200, "memory_s": 5.0}
    load |= {"iterations": 20, "settled_s": 5.0}
    results = identified(tmp_path, logs, train="a", test="b", load=load, body_draws=3)
    found = results.loads.set_index(["pair", "gains"])
    assert found.loc[("aLoad", "found"), "mass_kg"] == pytest.approx(0.8, rel=0.1)
    assert found.loc[("aLoad", "found"), "centre_x_m"] == pytest.approx(0.2, abs=0.03)
    assert set(results.motions["part"]) == {"learned from", "with the load", "tested on"}
    assert set(results.errors["part"]) == {"train", "b"}
    assert {"mass_kg", "viscous"} <= set(results.bodies["parameter"])
    assert set(results.carried["stage"]) == {"empty, learned from", "empty, another motion", "with the load"}
    with pytest.raises(ValidationError, match="drives and load need logs that are named"):
        parameters(load=load)


def test_offsets_and_a_prior_are_options(tmp_path):
    """Of sensors that are not zeroed the model with an offset is judged, and its URDF has the right links."""
    logs = [made_up_log(arm()[0], f"log {seed}", seed) for seed in range(2)]
    logs = [replace(log, torques=log.torques + 2.0) for log in logs]
    options = {"judged_friction": "offset", "joint_weights": "limit", "prior": 1e-6}
    results = identified(tmp_path, logs, **options)
    errors = results.errors.query("part == 'test' and model == 'cov'").groupby("friction")["nmse"].max()
    assert errors["offset"] < 0.02 < errors["coulomb"]
    base = base_parameters(arm()[0].tree)
    true = base.values(heavier(arm()[0].inertias))
    assert np.abs(base.values(read_urdf(tmp_path / "identified.urdf").inertias) - true).max() < 0.1
    with pytest.raises(ValidationError, match="structures lack cov"):
        parameters(structures=["tri"])


def test_sign_and_payload_of_slow_motion_are_found(tmp_path):
    point, robot = np.array([0.05, -0.02, 0.1]), arm()[0]
    time = 0.1 * np.arange(200)
    q = 0.3 + 0.2 * np.sin(0.3 * time[:, None] + np.arange(3))
    qd = 0.06 * np.cos(0.3 * time[:, None] + np.arange(3))
    motion = Motion(q, qd, np.gradient(qd, 0.1, axis=0, edge_order=2), np.zeros_like(q))
    carried = link_parameters(robot.inertias.tensors()).numpy()
    carried[20:24] += 2.0 * np.append(1.0, point)
    torque = torque_regressor(robot.tree, motion.q, motion.qd, motion.qdd) @ carried
    stamps = (1e9 * time).astype(np.int64)
    log = JointLog("slow", JOINTS, stamps, q, qd, -torque)
    its = identified(tmp_path, [log], structures=[], rate_hz=10.0, smoothing_hz=10.0, rest_rad_s=None)
    found = its.payloads.set_index("sign").loc[-1]
    assert found["mass_kg"] == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(found[["centre_x_m", "centre_y_m", "centre_z_m"]], point, atol=1e-3)
    left = its.payload_torques.groupby(["sign", "payload"])["left_n_m"].max()
    assert left[-1, True] < 1e-3 < left[-1, False] < left[1, False]
    _, with_payload = torque_check_panels(its.payload_torques)
    measured, model = with_payload.axes[0].lines[-1].get_data()  # with the sign reversed
    np.testing.assert_allclose(model, measured, atol=1e-3)
    assert set(its.gravity["holds"]) <= {"no", "not tested"}
