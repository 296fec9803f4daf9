"""Public logs of arms: their pages with made-up tables, and the protocol on the recorded arms, reduced."""

from types import SimpleNamespace

import numpy as np
import pybullet
import pytest
from committed import committed_entry
from motion_tables import JOINTS, made_up
from readers_bags import recorded_data

from dissertation.evidence.claims import judge, read_claims
from dissertation.recorded.readers import kuka_lwr4, ur10e
from structlearn.core.errors import MissingInputError
from structlearn.readers.joint_log import DriveLog
from structlearn.rigid_body.model_comparison import LEAST_SQUARES, TRAIN
from structlearn.rigid_body.motion import Motion
from structlearn.tasks.motion import parameters as protocol
from structlearn.tasks.motion.drives_and_load import found_gains
from structlearn.tasks.motion.learning import CARRIES, learn_motion, logs_that_are_there, read_task_arm
from structlearn.tasks.motion.motion_results import MotionResults, motion_findings
from structlearn.tasks.motion.page import motion_facts, motion_tables
from structlearn.tasks.motion.repeated_motion import repeats

PARAMETERS = committed_entry("ur10e")
DRIVES, LOAD = PARAMETERS.drives, PARAMETERS.load


def verdicts(root, name: str, results: MotionResults) -> dict[str, str]:
    """By evidence."""
    claims = read_claims(root / f"src/dissertation/recorded/claims/{name}.yaml")
    facts = {"published": {"default_nmse": 0.74, "structures_nmse": 0.35}, "motion": motion_facts(results)}
    judged = judge(claims, motion_findings(results), facts)
    return {one.claim.evidence: one.verdict for one in judged}


@pytest.mark.parametrize("name", JOINTS)
def test_a_good_outcome_is_yes(root, name):
    expected = {"yes"} | ({"not tested"} if name == "ur10e" else set())  # 22 s carry the load too briefly
    assert set(verdicts(root, name, made_up(name)).values()) - {"holds by construction"} <= expected
    tables = motion_tables(made_up(name))
    assert {"motion_joints", "motion_errors", "motion_whole", "motion_bodies"} <= set(tables)
    assert (tables["motion_errors"].frame["mean"] > 0.0).all()


def test_findings_are_those_of_the_tables_and_intervals_hold_them():
    find, entry = motion_findings(made_up("ur10e")), PARAMETERS
    assert len(find["errors"]) == 12  # of every joint in both logs that were not trained on
    for its in find["errors"].values():
        assert its.value == pytest.approx(0.004, rel=0.01)
        assert its.low <= its.value
    assert find["load_kg"].value == pytest.approx(entry.load.known_kg)
    assert find["load_kg"].low < entry.load.known_kg < find["load_kg"].high
    (carried,) = find["load_carried"].values()  # the other log is too short for an interval
    assert carried.value == pytest.approx(2.0, abs=0.1)
    whole = motion_findings(made_up("kuka_lwr4"))
    assert whole["relative_percent"].value == pytest.approx(100.0 * np.sqrt(0.0001), rel=0.01)
    rms = np.sqrt(0.0001 * 50.0)
    assert whole["limit_percent"].value == pytest.approx(100.0 * rms / 200.0, rel=0.01)


def test_without_a_rest_or_a_load_the_remaining_findings_are_there(root):
    tables = dict(made_up("ur10e"))
    for name in ("drives", "drive_draws"):
        tables[name] = tables[name][tables[name]["quantity"] != protocol.AT_REST]
    tables["gains"] = tables["gains"].assign(assumed=False)
    tables |= {name: tables[name][:0] for name in ("loads", "load_draws", "carried")}
    results = MotionResults(tables, PARAMETERS)
    found = verdicts(root, "ur10e", results)
    assert found["assumed_gains"] == found["load_kg"] == found["load_carried"] == "not tested"
    assert found["errors"] == "yes"
    assert motion_facts(results)["rest_log"] is None
    assert "motion_loads" not in motion_tables(results)


def test_a_joint_without_a_gain_at_rest_has_that_of_its_motion():
    drives = made_up("ur10e")["drives"].copy()
    rests = drives["quantity"] == protocol.AT_REST
    drives.loc[rests & drives["joint"].isin([1, 3]), "value"] = np.nan
    drives.loc[drives["quantity"] == protocol.IN_MOTION, "value"] = 12.0
    gains = found_gains(drives, PARAMETERS).set_index("joint")
    assert gains["found"].tolist() == [11.0, 11.0, 12.0, 11.0, 11.0, 11.0]  # joint 2 stands in for 1
    assert gains.index[gains["assumed"]].tolist() == [1]
    never = PARAMETERS.model_copy(update={"drives": DRIVES.model_copy(update={"rest": None})})
    assert found_gains(drives[~rests], never)["found"].eq(12.0).all()


def logs_of(**lengths_s: float) -> dict[str, DriveLog]:
    """Logs that rest or move at 10 Hz, by name."""
    made = {}
    for name, length in lengths_s.items():
        time = np.arange(0.0, length, 0.1)
        speed = np.zeros((len(time), 1)) if name.startswith("still") else np.cos(time)[:, None]
        zero = np.zeros_like(speed)
        made[name] = DriveLog(name, ("one",), (1e9 * time).astype(np.int64), zero, speed, zero, zero, zero)
    return made


def test_other_logs_take_the_place_of_those_that_are_missing():
    logs = logs_of(
        still=3.0, short=5.0, long=9.0, longLoad=8.0, a_unload=6.0, a_load=6.0, b_load_2600=7.0, xLoad=4.0
    )
    found = logs_that_are_there(logs, PARAMETERS)
    assert (found.drives.rest, found.train, found.test) == ("still", "long", "a_unload")
    assert found.load.pairs == (("long", "longLoad"), ("a_unload", "a_load"), ("long", "xLoad"))
    assert [name for name in ("c_noload", "no_load_1") if CARRIES.search(name)] == []
    one = logs_of(long=9.0, short=5.0)
    assert logs_that_are_there(one, PARAMETERS).drives.rest is None
    with pytest.raises(MissingInputError, match="of 2 logs 1 are motions of all joints without a load"):
        logs_that_are_there(logs_of(still=3.0, long=9.0), PARAMETERS)
    names = dict.fromkeys((PARAMETERS.train, PARAMETERS.test, *sum(LOAD.pairs, ())), 5.0)
    logs = logs_of(**names, still=3.0, longer=9.0)
    logs[DRIVES.rest] = logs["still"]
    assert logs_that_are_there(logs, PARAMETERS) == PARAMETERS


def identified(name: str, logs: list, folder, **changes) -> SimpleNamespace:
    """Tables of a public set by name, with reduced settings."""
    chosen = committed_entry(name, urdf=str(recorded_data(name) / f"{name}.urdf"), draws=100, **changes)
    robot, urdf = read_task_arm(chosen)
    _, tables = learn_motion(robot, {log.name: log for log in logs}, chosen, urdf, folder)
    return SimpleNamespace(**tables, robot=robot, chosen=chosen, urdf=folder / "identified.urdf")


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    """Drives, the load and the URDF of the recorded UR10e, without networks."""
    changes = {"rate_hz": 50.0, "structures": ["cov"], "iterations": 150, "body_draws": 0, "networks": None}
    changes["load"] = {"batch": 200, "iterations": 60}  # 4 s
    logs = ur10e.read_motion(recorded_data("ur10e"))
    return identified("ur10e", logs, tmp_path_factory.mktemp("ur10e"), **changes)


def test_the_recorded_arm_is_known_as_well_as_least_squares_know_it_with_its_load_and_drives(loaded):
    its = loaded.errors[loaded.errors["part"] == loaded.chosen.test]
    worst = its.groupby(["model", "friction"])["nmse"].max()
    assert worst["cov", "coulomb"] <= min(0.012, 1.1 * worst[LEAST_SQUARES, "coulomb"])
    assert worst["cov", "viscous"] > 0.1
    masses, known = loaded.loads.set_index(["pair", "gains"])["mass_kg"], loaded.chosen.load.known_kg
    assert masses[protocol.ALL_PAIRS, protocol.FOUND] == pytest.approx(known, rel=0.02)
    assert masses[protocol.ALL_PAIRS, protocol.QUOTED] > 1.05 * known
    carried = loaded.carried.query("stage == @protocol.CARRYING and since_s > 20.0")
    assert (carried["mass_kg"] / known - 1.0).abs().mean() < 0.05
    gains = [11.976, 11.976, 9.839, 10.766, 10.779, 10.766]
    np.testing.assert_allclose(loaded.gains["found"], gains, atol=1e-3)
    late = loaded.drives.query("quantity == @protocol.DELAY").groupby("log")["value"].mean()
    assert late.between(0.005, 0.02).all()
    kept = loaded.motions.set_index("log").loc[loaded.chosen.train]
    assert kept["start_s"] > 2.0  # not what moves the arm to the start
    assert kept["end_s"] - kept["start_s"] == pytest.approx(50.0, abs=0.3)


def test_the_recorded_arm_goes_through_its_urdf(loaded):
    assert loaded.written["difference_n_m"].max() < 1e-10
    client = pybullet.connect(pybullet.DIRECT)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(str(loaded.urdf), useFixedBase=True, flags=flags, physicsClientId=client)
    joints = [pybullet.getJointInfo(body, one, client) for one in range(pybullet.getNumJoints(body, client))]
    pybullet.disconnect(client)
    moving = [one for one in joints if one[2] == pybullet.JOINT_REVOLUTE]
    assert [one[1].decode() for one in moving] == list(loaded.robot.tree.names)
    assert all(min(one[6:8]) > 0.0 for one in moving)  # viscous and Coulomb friction


def test_the_published_test_log_of_the_kuka_repeats_its_training_log(tmp_path):
    """As of the published identification, errors are those of a repetition; they are of the same size."""
    its = identified(
        "kuka_lwr4", kuka_lwr4.read_motion(recorded_data("kuka_lwr4")), tmp_path, structures=["cov"]
    )
    assert its.repeats["repeated"].all()
    assert its.repeats["difference"].item() < 0.01
    names = ("motions", "errors", "blocks", "norms", "gravity")
    results = MotionResults({name: getattr(its, name) for name in names}, its.chosen)
    whole = {name: one.value for name, one in results.whole_errors(("cov", "offset")).items()}
    assert whole["limit_percent"] < 0.211  # the largest of four published
    assert its.links[["positive_mass", "positive_definite", "triangle"]].all(axis=None)


def test_the_halves_of_the_motion_of_the_kuka_differ():
    differing = committed_entry("kuka_lwr4_differing")
    first, _ = kuka_lwr4.read_motion(recorded_data("kuka_lwr4"), differing)
    assert first.time[-1] == pytest.approx(differing.part, abs=0.01)
    motion = Motion(first.positions, *np.zeros((3, *first.positions.shape)))
    start, rest = motion.split(differing.train_share)
    assert repeats({TRAIN: [("1", start)], "test": [("1", rest)]}, 200.0)["difference"].item() > 1.0
