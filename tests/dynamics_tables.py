"""Made-up results of the dynamics stages, as their tables are."""

from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pybullet_data
from committed import committed

from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_learning import KINDS, LOSSES
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH
from structlearn.rigid_body.online_learning import OnlineParameters
from structlearn.rigid_body.seeded_training import DynamicsTrainingParameters
from structlearn.rigid_body.tree import Robot, read_urdf
from structlearn.testbeds.dynamics.names import IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

SEEDS, JOINTS = 3, 7

EPOCHS = {"nostr": 12, "symm": 6, "spd": 2, "tri": 2, "cov": 2}
"""After which a structure is good enough in simulation; networks never are."""

VELOCITY = {GROUND_TRUTH: 0.01, "mlp": 5.0, "delan": 0.3, "nostr": 0.05}
"""NMSE of the tool's velocity in simulation; of other models as of the ground truth."""

IIWA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"


@lru_cache
def iiwa() -> Robot:
    return read_urdf(IIWA)


def trainings():
    """Keys of all trainings, with the epochs to the threshold (NaN: not reached) and the final NMSE."""
    found = []
    for kind in KINDS:
        structured = kind in STRUCTURES
        for loss in LOSSES:
            reached = EPOCHS.get(kind, np.nan)
            found.append((IDEAL, kind, "none", loss, "scheduled", reached, 0.05 if structured else 0.8))
            frictions = ("viscous", "coulomb") if structured or kind == "delan" else ("none",)
            for friction in frictions:
                error = (0.004 if friction == "coulomb" else 0.03) if structured else 0.05
                found.append((ROBOT, kind, friction, loss, "scheduled", 1.0, error))
        if structured:
            found.append((IDEAL, kind, "none", "raw", "plain", EPOCHS[kind], 0.05))
    return found


def training_tables():
    errors, outcomes = [], []
    names = ["data", "model", "friction", "loss", "optimiser"]
    for (*key, reached, error), seed in product(trainings(), range(SEEDS)):
        last = 15 if np.isnan(reached) else int(reached)
        keys = dict(zip(names, key, strict=True)) | {"seed": seed}
        final = error * (1.0 + 0.1 * seed)
        outcome = {"epochs": reached, "epochs_but_last": 1.0, "nmse_mean": final, "nmse_max": 2.0 * final}
        outcomes.append(keys | outcome)
        for epoch, joint in product(range(last + 1), range(1, JOINTS + 1)):
            nmse = final if epoch == last else 100.0
            errors.append(keys | {"epoch": epoch, "joint": joint, "nmse": nmse})
    return pd.DataFrame(errors), pd.DataFrame(outcomes)


def body_tables():
    links, base = [], []
    centres = {f"{prefix}centre_{axis}_m": 0.1 for prefix in ("", "true_") for axis in "xyz"}
    moments = {f"{prefix}moment_{place}_kg_m2": 0.01 for prefix in ("", "true_") for place in "123"}
    for model, seed in product(STRUCTURES, range(SEEDS)):
        keys = {"model": model, "loss": "raw", "seed": seed}
        kept = {"positive_definite": model != "nostr", "triangle": model in ("tri", "cov")}
        for number, name in enumerate(iiwa().tree.names):
            masses = {"mass_kg": 1.5 * (number + 1.0), "true_mass_kg": number + 1.0, "positive_mass": True}
            links.append(keys | {"link": name} | masses | centres | moments | kept)
        for name, truth in (("hx[a]", 0.001), ("Izz[a]", 0.02), ("m[b]", 2.0)):
            base.append(keys | {"parameter": name, "truth": truth, "value": 1.01 * truth})
    return pd.DataFrame(links), pd.DataFrame(base)


def tracking_tables():
    """Scores of all models, and reaches of one seed in which a worse model lags more."""
    scores, paths = [], []
    time = np.arange(0.0, 2.0, 0.04)
    for robot, models in (
        (IDEAL, (GROUND_TRUTH, *KINDS)),
        (ROBOT, (GROUND_TRUTH, DEFAULT, *KINDS, f"cov{COULOMB}")),
    ):
        for model in models:
            stopped = "speed limit" if (robot, model) == (ROBOT, "delan") else ""
            score = VELOCITY.get(model, 0.01)
            end = 10 if stopped else len(time)
            for seed, task in product(range(SEEDS), ("sine", "reach")):
                numbers = {"position_nmse": 0.005, "velocity_nmse": score * (1.0 + 0.1 * seed)}
                key = {"robot": robot, "model": model, "seed": seed, "task": task}
                halted = {"stopped": stopped if task == "reach" else "", "duration_s": time[end - 1]}
                scores.append(key | numbers | halted)
            path = pd.DataFrame({"robot": robot, "model": model, "task": "reach", "time_s": time[:end]})
            for name in iiwa().tree.names:
                path[name] = 0.2 * time[:end]
            for axis in "xyz":
                path[f"wanted_{axis}"] = 0.4 + 0.1 * np.sin(time[:end])
                path[f"tool_{axis}"] = path[f"wanted_{axis}"] + 0.01 * score
            paths.append(path)
    return pd.DataFrame(scores), pd.concat(paths, ignore_index=True)


def online_table():
    """The strict structures learn ten times as fast as all others."""
    start = dict.fromkeys(KINDS, 1000.0) | dict.fromkeys(("spd", "tri", "cov"), 100.0)
    keys = product(KINDS, LOSSES, range(SEEDS), range(12), range(1, JOINTS + 1))
    table = pd.DataFrame(keys, columns=["model", "loss", "seed", "batch", "joint"])
    return table.assign(nmse=table["model"].map(start) * 0.8 ** table["batch"])


def payload_table(settled_after=3.0):
    """A payload of 1.5 kg from 120 s on, whose learned mass is right after some time."""
    time = np.arange(1.0, 241.0)
    mass = np.where(time <= 120.0, 0.0, np.where(time <= 120.0 + settled_after, 0.7, 1.49))
    moments = {f"moment_{axis}_kg_m": 0.1 * mass * (axis == "z") for axis in "xyz"}
    errors = {"nmse_fixed": np.where(time <= 120.0, 1e-7, 0.6), "nmse_learned": np.full(len(time), 1e-4)}
    return pd.DataFrame({"time_s": time, **errors, "mass_kg": mass, **moments})


def known_table():
    rows = product(((GROUND_TRUTH, 0.003), (DEFAULT, 0.3)), range(1, JOINTS + 1))
    rows = [(model, joint, error) for (model, error), joint in rows]
    return pd.DataFrame(rows, columns=["model", "joint", "nmse"])


def friction_rows():
    rows = []
    for model, terms in (("cov", ("viscous",)), (f"cov{COULOMB}", ("viscous", "coulomb"))):
        value = 2.0 if model == "cov" else 0.55
        keys = product([model], range(SEEDS), range(1, JOINTS + 1), terms)
        rows += [(*key, value, 0.5) for key in keys]
    return pd.DataFrame(rows, columns=["model", "seed", "joint", "term", "value", "truth"])


def residual_table():
    speed = np.tile(np.linspace(-1.0, 1.0, 20), JOINTS)
    friction = 0.5 * np.sign(speed)
    joints = np.repeat(np.arange(1, JOINTS + 1), 20)
    columns = {"velocity_rad_s": speed, "residual_n_m": 1.1 * friction, "friction_n_m": friction}
    return pd.DataFrame({"joint": joints, **columns})


def dynamics_results() -> DynamicsResults:
    errors, outcomes = training_tables()
    links, base = body_tables()
    scores, paths = tracking_tables()
    agreement = {"largest_n_m": 90.0, "recursion_n_m": 1e-14, "regressor_n_m": 3e-13, "compiled_n_m": 2e-14}
    return DynamicsResults(
        errors=errors,
        outcomes=outcomes,
        links=links,
        base=base,
        scores=scores,
        paths=paths,
        online=online_table(),
        payload=payload_table(),
        agreement=pd.DataFrame([{"robot": name} | agreement for name in ("one", "two", "three")]),
        engines=pd.DataFrame({"joint_rad": [1e-15, 3e-15], "torque_n_m": [4e-13, 2e-13]}),
        known=known_table(),
        friction=friction_rows(),
        residuals=residual_table(),
        stand_in=committed(StandInParameters, "stand_in"),
        motion=committed(SineParameters, "arm_motion"),
        training=committed(DynamicsTrainingParameters, "train_dynamics", seeds=SEEDS),
        learning_online=committed(OnlineParameters, "online", seeds=SEEDS),
        tracking=committed(TrackingParameters, "track", seeds=SEEDS),
        carried=committed(PayloadParameters, "record_motion.payload"),
    )
