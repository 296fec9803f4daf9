"""Tables of arms' logs as the protocol writes them, made up: a good outcome."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pandas as pd
from committed import committed_entry

from structlearn.rigid_body.model_comparison import LEAST_SQUARES, NETWORKS, URDF
from structlearn.tasks.motion import parameters as protocol
from structlearn.tasks.motion.differing_motion import ALL, LEARNED, REFITTED, REPEATABILITY
from structlearn.tasks.motion.motion_results import MotionResults

DRAWS = 60
STRUCTURES = ("nostr", "symm", "spd", "tri", "cov", LEAST_SQUARES)
MODELS = {
    (URDF, "none"): 1.0,
    **{(kind, friction): 0.4 for kind, frictions in NETWORKS.items() for friction in frictions},
    **{(kind, "viscous"): 0.1 for kind in STRUCTURES},
    **{(kind, "coulomb"): 0.004 for kind in STRUCTURES},
    **{(kind, friction): 0.0001 for kind in STRUCTURES for friction in ("offset", "stiffness")},
}
"""NMSE of every joint."""

LOST = {LEARNED: 0.15, **dict.fromkeys(REFITTED, 0.12), ALL: 0.1, REPEATABILITY: 0.09}
"""Rms errors on motion that differs, in N m."""

JOINTS = {"panda": 7, "ur10e": 6, "kuka_lwr4": 7, "kuka_lwr4_differing": 7}


def rows(keys: Mapping[str, object], **columns) -> pd.DataFrame:
    return pd.DataFrame({**keys, **columns})


@lru_cache
def made_up(name: str) -> MotionResults:
    """What the stage would write of a public set, with narrow intervals."""
    entry, joints = committed_entry(name), np.arange(1, JOINTS[name] + 1)
    parts = ("train", entry.test or "test") + (("20_01_31-unload",) if name == "ur10e" else ())
    tables = _errors(parts, joints)
    links = rows({"model": "cov"}, link=list("abcdefg"[: len(joints)]))
    links = links.assign(positive_mass=True, positive_definite=True, triangle=True)
    parameters = ("mass_kg", "centre_x_m", "ixx_kg_m2", "viscous", "coulomb")
    bodies = [rows({"parameter": one, "value": 1.5, "urdf": 1.0}, link=links["link"]) for one in parameters]
    traced = {"_".join(key).removesuffix("_none"): np.sin(np.arange(10.0 * len(joints))) for key in MODELS}
    logs = [entry.train or "exciting_traj", *parts[1:]]
    tables |= {
        "links": pd.concat([links.assign(friction=one) for one in ("coulomb", "offset", "stiffness")]),
        "bodies": pd.concat(bodies).assign(half_width=0.1 if entry.body_draws else np.nan),
        "motions": rows({"start_s": 1.0, "end_s": 31.0, "length_s": 40.0, "tested_s": 30.0}, log=logs).assign(
            part="tested on", learned_s=[30.0] + [0.0] * (len(logs) - 1)
        ),
        "traces": rows(
            {},
            time_s=np.tile(np.arange(10.0), len(joints)),
            joint=joints.repeat(10),
            measured=np.cos(np.arange(10.0 * len(joints))),
            **traced,
        ),
        "gravity": rows(
            {"gravity_n_m": 5.0, "torque_n_m": 6.0, "share": 1.0, "holds": "yes", "limit_n_m": 100.0},
            joint=joints,
            name=[f"joint_{joint}" for joint in joints],
        ),
        "repeats": pd.DataFrame({"part": parts[1:], "log": parts[1:]}).assign(
            trained_on=logs[0], lag_s=0.0, difference=1.4, repeated=False
        ),
        "base": rows({"parameter": "m[a]", "low": 0.5, "high": 1.5, "urdf": 1.0}, value=[1.0]),
        "fitness": rows({"question": "condition number", "joint": 0, "verdict": "yes"}, value=[50.0]),
        "determined": rows({"parameter": "m[a]", "determined": "doubtful"}, percent=[50.0]),
        "excitation": rows({"parameters": 40}, condition=[50.0]),
        "differing": pd.concat(
            rows({"fitted": name, "rmse_n_m": size, "nmse": size**2}, joint=joints).assign(
                learned_s=30.0, tested_s=30.0, halved=False
            )
            for name, size in LOST.items()
        ),
        "written": rows({}, joint=joints, difference_n_m=1e-13),
    }
    if entry.networks is not None:
        its = {"hidden": "8", "rate": 0.01, "epochs": 3, "chosen": True}
        tables["choice"] = rows(its, kind=list(NETWORKS), nmse=0.3)
    if entry.drives is not None:
        tables |= _drives(entry, joints) | _load(entry)
    return MotionResults(tables, entry)


def _errors(parts, joints) -> dict[str, pd.DataFrame]:
    errors, blocks, norms = [], [], []
    count = len(joints)
    for part in parts:
        torque = 5.0 * np.where(np.arange(20) % 2, 1.0, -1.0).repeat(count)
        its = {"samples": 100.0, "torque": 100.0 * torque, "torque_squared": 100.0 * (torque**2 + 25.0)}
        lengths = {"samples": np.full(20, 100.0)}
        for key, level in MODELS.items():
            keys = {"model": key[0], "friction": key[1], "part": part}
            for seed in range(3 if key[0] in NETWORKS else 1):
                errors.append(rows(keys | {"seed": seed}, joint=joints, nmse=level * (1.0 + 0.001 * seed)))
            wobble = 1.0 + 0.001 * np.arange(20) % 0.003
            its["/".join(key)] = 100.0 * 50.0 * level * wobble.repeat(count)
            lengths["/".join(key)] = 100.0 * np.sqrt(50.0 * level * count) * wobble
        keys = {"part": part, "block": np.arange(20).repeat(count), "joint": np.tile(joints, 20)}
        blocks.append(rows(keys, **its))
        norms.append(rows({"part": part, "block": np.arange(20)}, **lengths))
    named = {"errors": errors, "blocks": blocks, "norms": norms}
    return {name: pd.concat(its, ignore_index=True) for name, its in named.items()}


def _drives(entry, joints) -> dict[str, pd.DataFrame]:
    spread = 1.0 + 0.01 * np.linspace(-1.0, 1.0, DRAWS)
    drives, drawn = [], []
    values = {
        (protocol.AT_REST, entry.drives.rest): 11.0,
        (protocol.IN_MOTION, entry.train): 11.0,
        (protocol.IN_MOTION, entry.test): 11.0,
        (protocol.DELAY, entry.train): 0.01,
        (protocol.DELAY, entry.test): 0.01,
    }
    for (quantity, log), value in values.items():
        keys = {"quantity": quantity, "log": log}
        drives.append(rows(keys | {"blocks": 20}, joint=joints, value=value))
        many = {"draw": np.arange(DRAWS).repeat(len(joints)), "joint": np.tile(joints, DRAWS)}
        drawn.append(rows(keys, **many, value=value * spread.repeat(len(joints))))
    delays = np.linspace(*entry.drives.delays_s, 5)
    curve = {"delay_s": delays.repeat(len(joints)), "joint": np.tile(joints, 5)}
    assumed = np.isin(joints, list(entry.drives.assumed_gains))
    return {
        "drives": pd.concat(drives),
        "drive_draws": pd.concat(drawn),
        "gains": rows({}, joint=joints, found=11.0, assumed=assumed, quoted=entry.drives.quoted_gains),
        "delay_curves": rows({"log": entry.train}, **curve, squares=1.0 + curve["delay_s"] ** 2),
    }


def _load(entry) -> dict[str, pd.DataFrame]:
    spread, true = 1.0 + 0.01 * np.linspace(-1.0, 1.0, DRAWS), entry.load.known_kg
    masses = {protocol.FOUND: true, protocol.QUOTED: 1.1 * true}
    loads, drawn, carried = [], [], []
    pairs = [pair[1] for pair in entry.load.pairs]
    for gains, mass in masses.items():
        for pair in (*pairs, protocol.ALL_PAIRS):
            keys = {"pair": pair, "gains": gains}
            loads.append(rows(keys | {"blocks": 20}, mass_kg=[mass], **dict.fromkeys(CENTRE, 0.1)))
            drawn.append(rows(keys, draw=np.arange(DRAWS), mass_kg=mass * spread))
    for log, seconds in zip(pairs, (50, 22), strict=True):
        for number, stage in enumerate((protocol.LEARNED, protocol.EMPTY, protocol.CARRYING)):
            since = np.arange(1.0, seconds + 1.0)
            mass = 0.0 if stage != protocol.CARRYING else 1.02 * true
            its = {
                "time_s": since + number * seconds,
                "since_s": since,
                "mass_kg": mass + 0.01 * np.sin(since),
            }
            its |= {f"moment_{axis}_kg_m": 0.1 * mass for axis in "xyz"}
            carried.append(rows({"log": log, "stage": stage}, **its, nmse_fixed=0.3, nmse_learned=0.1))
    return {
        "loads": pd.concat(loads, ignore_index=True),
        "load_draws": pd.concat(drawn, ignore_index=True),
        "carried": pd.concat(carried, ignore_index=True),
    }


CENTRE = [f"centre_{axis}_m" for axis in "xyz"]
