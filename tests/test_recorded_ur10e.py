"""The recorded UR10e: the protocol on reduced settings, and its page with made-up tables."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pybullet
import pytest
from committed import committed
from readers_bags import recorded_data
from reporting_verdicts import AnyFigure
from viewer_files import contents, note

from structlearn.core.errors import MissingInputError
from structlearn.readers.joint_log import DriveLog
from structlearn.readers.ur10e import URDF, read_logs
from structlearn.reporting.document import render
from structlearn.rigid_body.arm_identification import LEAST_SQUARES, NETWORKS
from structlearn.rigid_body.arm_identification import URDF as MAKER
from structlearn.rigid_body.tree import read_urdf
from structlearn.tasks.motion import drives_and_load as protocol
from structlearn.tasks.motion.joint_motion import CARRIES, learn_motion, logs_that_are_there
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.assembly import recorded_report
from structlearn.tasks.public.page.parts.ur10e_figures import STAGES
from structlearn.tasks.public.page.parts.ur10e_results import Ur10eResults, ur10e_metrics
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.views.ur10e_recording import CARRYING, write_carried

PARAMETERS = committed(MotionParameters, "recorded_ur10e")
DRIVES, LOAD = PARAMETERS.drives, PARAMETERS.load
LOADED, JOINTS, DRAWS = "20_02_19_14harm50secLoad", 6, 60
PARTS = ("train", PARAMETERS.test, "20_01_31-unload")
MODELS = {
    (MAKER, "none"): 1.0,
    **{(kind, friction): 0.4 for kind, frictions in NETWORKS.items() for friction in frictions},
    **{(kind, "viscous"): 0.1 for kind in ("nostr", "symm", "spd", "tri", "cov", LEAST_SQUARES)},
    **{(kind, "coulomb"): 0.004 for kind in ("nostr", "symm", "spd", "tri", "cov", LEAST_SQUARES)},
}
"""A good outcome: NMSE of every joint."""

BAD = {
    (MAKER, "none"): 0.05,
    ("mlp", "none"): 0.01,
    ("mlp_scaled", "none"): 0.01,
    ("delan", "viscous"): 0.01,
    **{(kind, "coulomb"): 0.2 for kind in ("spd", "tri", "cov")},
}


def rows(keys: Mapping[str, object], **columns) -> pd.DataFrame:
    return pd.DataFrame({**keys, **columns})


def joints() -> np.ndarray:
    return np.arange(1, JOINTS + 1)


@lru_cache
def made_up(good: bool = True) -> Ur10eResults:
    """What the stage would write, with narrow intervals on the side that is asked for."""
    levels = MODELS | ({} if good else BAD)
    spread = 1.0 + 0.01 * np.linspace(-1.0, 1.0, DRAWS)
    errors, blocks = [], []
    for part in PARTS:
        torque = 5.0 * np.where(np.arange(20) % 2, 1.0, -1.0).repeat(JOINTS)
        its = {"samples": 100.0, "torque": 100.0 * torque, "torque_squared": 100.0 * (torque**2 + 25.0)}
        for key, level in levels.items():
            errors.append(
                rows(
                    {"model": key[0], "friction": key[1], "seed": 0, "part": part}, joint=joints(), nmse=level
                )
            )
            wobble = 1.0 + 0.001 * np.arange(20).repeat(JOINTS) % 0.003
            its["/".join(key)] = 100.0 * 50.0 * level * wobble
        keys = {"part": part, "block": np.arange(20).repeat(JOINTS), "joint": np.tile(joints(), 20)}
        blocks.append(rows(keys, **its))
    drives, drawn = [], []
    values = {
        (protocol.AT_REST, DRIVES.rest): 11.0,
        (protocol.IN_MOTION, PARAMETERS.train): 11.0 if good else 14.0,
        (protocol.IN_MOTION, PARAMETERS.test): 11.0,
        (protocol.DELAY, PARAMETERS.train): 0.01 if good else -0.01,
        (protocol.DELAY, PARAMETERS.test): 0.01,
    }
    for (quantity, log), value in values.items():
        keys = {"quantity": quantity, "log": log}
        drives.append(rows(keys | {"blocks": 20}, joint=joints(), value=value))
        many = {"draw": np.arange(DRAWS).repeat(JOINTS), "joint": np.tile(joints(), DRAWS)}
        drawn.append(rows(keys, **many, value=value * spread.repeat(JOINTS)))
    assumed = np.isin(joints(), list(DRIVES.assumed_gains))
    true = LOAD.known_kg
    masses = {protocol.FOUND: true if good else 1.2 * true, protocol.QUOTED: 1.1 * true if good else true}
    loads, load_draws = [], []
    for gains, mass in masses.items():
        for pair in (LOADED, "20_01_31-load", protocol.BOTH):
            keys = {"pair": pair, "gains": gains}
            centre = {f"centre_{axis}_m": [0.1] for axis in "xyz"}
            loads.append(rows(keys, blocks=[20], mass_kg=[mass], **centre))
            load_draws.append(rows(keys, draw=np.arange(DRAWS), mass_kg=mass * spread))
    carried = []
    for log, seconds in ((LOADED, 50), ("20_01_31-load", 22)):
        for number, stage in enumerate(STAGES):
            since = np.arange(1.0, seconds + 1.0)
            mass = 0.0 if stage != CARRYING else true * (1.02 if good else 1.5)
            moments = {f"moment_{axis}_kg_m": 0.1 * mass for axis in "xyz"}
            its = {
                "time_s": since + number * seconds,
                "since_s": since,
                "mass_kg": mass + 0.01 * np.sin(since),
            }
            carried.append(
                rows({"log": log, "stage": stage}, **its, nmse_fixed=0.3, nmse_learned=0.1, **moments)
            )
    links = rows(
        {"model": "cov", "friction": "coulomb"},
        link=list("abcdef"),
        positive_mass=True,
        positive_definite=good,
        triangle=True,
    )
    delays = np.linspace(*DRIVES.delays_s, 5)
    curve = {"delay_s": delays.repeat(JOINTS), "joint": np.tile(joints(), 5)}
    logs = (*PARTS[1:], PARAMETERS.train, LOADED, "20_01_31-load")
    bodies = [
        rows({"parameter": name}, link=list("abcdef"), value=1.5, half_width=0.1, urdf=1.0)
        for name in ("mass_kg", "centre_x_m", "ixx_kg_m2", "viscous", "coulomb")
    ]
    traced = {"_".join(key).removesuffix("_none"): np.sin(np.arange(60.0)) for key in MODELS}
    tables = {
        "drives": pd.concat(drives),
        "drive_draws": pd.concat(drawn),
        "gains": rows({}, joint=joints(), found=11.0, assumed=assumed, quoted=DRIVES.quoted_gains),
        "delay_curves": rows({"log": PARAMETERS.train}, **curve, squares=1.0 + curve["delay_s"] ** 2),
        "motions": rows({"part": "asked about"}, log=logs, start_s=1.0, end_s=31.0, length_s=40.0),
        "errors": pd.concat(errors, ignore_index=True),
        "blocks": pd.concat(blocks, ignore_index=True),
        "links": links,
        "traces": rows(
            {},
            time_s=np.tile(np.arange(10.0), 6),
            joint=joints().repeat(10),
            measured=np.cos(np.arange(60.0)),
            **traced,
        ),
        "choice": rows(
            {"hidden": "8", "rate": 0.01, "epochs": 3}, kind=list(NETWORKS), nmse=0.3, chosen=True
        ),
        "loads": pd.concat(loads, ignore_index=True),
        "load_draws": pd.concat(load_draws, ignore_index=True),
        "carried": pd.concat(carried, ignore_index=True),
        "bodies": pd.concat(bodies, ignore_index=True),
        "written": rows({}, joint=joints(), difference_n_m=1e-13 if good else 1e-3),
    }
    return Ur10eResults(tables, PARAMETERS)


def page(results: Ur10eResults):
    tables = {f"ur10e_{name}": table for name, table in results.tables.items()}
    known = RecordedResults(tables, parameters={"recorded_ur10e": PARAMETERS})
    return recorded_report(known, Path("no such folder")).pages["ur10e"]


def test_errors_are_those_of_the_table_and_intervals_hold_them():
    results = made_up()
    values = ur10e_metrics(results)
    for joint in joints():
        assert values[f"ur10e_nmse_{joint}"] == pytest.approx(0.004, rel=0.01)
        assert values[f"ur10e_nmse_{joint}_low"] <= values[f"ur10e_nmse_{joint}"]
    assert values["ur10e_load_kg"] == pytest.approx(LOAD.known_kg)
    assert values["ur10e_load_kg_low"] < LOAD.known_kg < values["ur10e_load_kg_high"]
    assert values["ur10e_load_carried_1_error_percent"] == pytest.approx(2.0, abs=0.1)
    assert "ur10e_load_carried_2_error_percent_low" not in values  # too short for an interval


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


def test_logs_that_are_there_are_what_the_parameters_say():
    names = dict.fromkeys((PARAMETERS.train, PARAMETERS.test, *sum(LOAD.pairs, ())), 5.0)
    logs = logs_of(**names, still=3.0, longer=9.0)
    logs[DRIVES.rest] = logs["still"]
    assert logs_that_are_there(logs, PARAMETERS) == PARAMETERS


def test_the_page_of_logs_without_a_rest():
    tables = dict(made_up().tables)
    for name in ("drives", "drive_draws"):
        tables[name] = tables[name][tables[name]["quantity"] != protocol.AT_REST]
    tables["gains"] = tables["gains"].assign(assumed=False)
    results = Ur10eResults(tables, PARAMETERS)
    judged = {one.claim.evidence: one.verdict for one in page(results).judged}
    assert judged["assumed_gains"] == "not tested"
    assert "There is no log at rest" in render(page(results), AnyFigure())


def test_without_the_load_the_rest_is_shown():
    tables = dict(made_up().tables)
    tables |= {name: tables[name][:0] for name in ("loads", "load_draws", "carried")}
    results = Ur10eResults(tables, PARAMETERS)
    judged = {one.claim.evidence: one.verdict for one in page(results).judged}
    assert judged["load"] == judged["load_carried"] == "not tested"
    assert judged["errors"] == "yes"
    assert "figure-ur10e_errors" in render(page(results), AnyFigure())
    assert not any(name.startswith("ur10e_load_kg") for name in ur10e_metrics(results))


def test_a_joint_without_a_gain_at_rest_has_that_of_its_motion():
    drives = made_up()["drives"].copy()
    rests = drives["quantity"] == protocol.AT_REST
    drives.loc[rests & drives["joint"].isin([1, 3]), "value"] = np.nan
    drives.loc[drives["quantity"] == protocol.IN_MOTION, "value"] = 12.0
    gains = protocol.found_gains(drives, PARAMETERS).set_index("joint")
    assert gains["found"].tolist() == [11.0, 11.0, 12.0, 11.0, 11.0, 11.0]  # joint 2 stands in for 1
    assert gains.index[gains["assumed"]].tolist() == [1]
    never = PARAMETERS.model_copy(update={"drives": DRIVES.model_copy(update={"rest": None})})
    assert protocol.found_gains(drives[~rests], never)["found"].eq(12.0).all()


def test_names_are_those_of_the_protocol():
    assert tuple(STAGES) == (protocol.LEARNED, protocol.EMPTY, protocol.CARRYING)
    assert protocol.CARRYING == CARRYING
    assert set(MODELS) - {(MAKER, "none")} <= set(
        (model, friction) for model in public_names.DYNAMICS_MODELS for friction in public_names.FRICTIONS
    )


@pytest.fixture(scope="module")
def folder() -> Path:
    return recorded_data("ur10e")


@pytest.fixture(scope="module")
def identified(folder, tmp_path_factory):
    """Drives, the load and the URDF of the recorded arm; networks are hardly trained."""
    changes = {
        "networks": {"hidden": [[4]], "rates": [0.01], "epochs": [1], "choice_seeds": 1, "seeds": 1},
        "load": {"batch": 200, "iterations": 60},  # 4 s
    }
    chosen = committed(
        MotionParameters, "recorded_ur10e", rate_hz=50.0, iterations=150, body_draws=3, draws=100, **changes
    )
    robot = read_urdf(folder / URDF)
    logs = {log.name: log for log in read_logs(folder)}
    target = tmp_path_factory.mktemp("ur10e")
    _, tables = learn_motion(robot, logs, chosen, folder / URDF, target)
    return robot, SimpleNamespace(**tables), chosen, target / "identified.urdf"


def test_the_recorded_arm_is_known_as_well_as_least_squares_know_it(identified):
    _, tables, chosen, _ = identified
    test = tables.errors[tables.errors["part"] == chosen.test].groupby(["model", "friction"])["nmse"]
    assert test.max()["cov", "coulomb"] <= 0.012
    assert test.max()["cov", "coulomb"] <= 1.1 * test.max()[LEAST_SQUARES, "coulomb"]
    assert test.max()["cov", "viscous"] > 0.1


def test_the_recorded_load_is_found(identified):
    _, tables, chosen, _ = identified
    masses = tables.loads.set_index(["pair", "gains"])["mass_kg"]
    assert masses[protocol.BOTH, protocol.FOUND] == pytest.approx(chosen.load.known_kg, rel=0.02)
    assert masses[protocol.BOTH, protocol.QUOTED] > 1.05 * chosen.load.known_kg
    carried = tables.carried.query("stage == @protocol.CARRYING and since_s > @chosen.load.settled_s")
    assert (carried["mass_kg"] / chosen.load.known_kg - 1.0).abs().mean() < 0.05


def test_the_recorded_drives_are_found(identified):
    _, tables, chosen, _ = identified
    np.testing.assert_allclose(
        tables.gains["found"], [11.976, 11.976, 9.839, 10.766, 10.779, 10.766], atol=1e-3
    )
    late = tables.drives.query("quantity == @protocol.DELAY").groupby("log")["value"].mean()
    assert late.between(0.005, 0.02).all()
    kept = tables.motions.set_index("log")
    assert kept.loc[chosen.train, "start_s"] > 2.0  # not what moves the arm to the start
    assert (kept["end_s"] - kept["start_s"])[chosen.train] == pytest.approx(50.0, abs=0.3)


def test_the_recorded_arm_goes_through_its_urdf(identified):
    robot, tables, _, urdf = identified
    assert tables.written["difference_n_m"].max() < 1e-10
    client = pybullet.connect(pybullet.DIRECT)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(str(urdf), useFixedBase=True, flags=flags, physicsClientId=client)
    joints = [pybullet.getJointInfo(body, one, client) for one in range(pybullet.getNumJoints(body, client))]
    pybullet.disconnect(client)
    moving = [one for one in joints if one[2] == pybullet.JOINT_REVOLUTE]
    assert [one[1].decode() for one in moving] == list(robot.tree.names)
    assert all(min(one[6:8]) > 0.0 for one in moving)  # viscous and Coulomb friction


def test_a_recording_shows_the_load_at_the_arm(identified, folder, tmp_path):
    _, tables, chosen, urdf = identified
    logs = {log.name: log for log in read_logs(folder)}
    shown = {name: getattr(tables, name) for name in ("carried", "motions", "loads")}
    write_carried(tmp_path / "ur10e.rrd", urdf, shown, logs.__getitem__, chosen.load)
    found = contents(tmp_path / "ur10e.rrd")[1]
    assert {"/load", "/mass/learned", "/arm/sticks/elbow_joint"} <= set(found)
    assert f"{chosen.load.known_kg:g} kg" in note(tmp_path / "ur10e.rrd")
