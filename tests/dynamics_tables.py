"""Made-up results of the dynamics stages, as their tables are."""

from functools import lru_cache
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
from structlearn.testbeds.recorded.protocol import panda_identification as recorded

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
    for *key, reached, error in trainings():
        for seed in range(SEEDS):
            last = 15 if np.isnan(reached) else int(reached)
            keys = dict(zip(names, key, strict=True)) | {"seed": seed}
            final = error * (1.0 + 0.1 * seed)
            outcome = {"epochs": reached, "epochs_but_last": 1.0, "nmse_mean": final, "nmse_max": 2.0 * final}
            outcomes.append(keys | outcome)
            for epoch in range(last + 1):
                value = final if epoch == last else 100.0
                errors += [
                    keys | {"epoch": epoch, "joint": joint, "nmse": value} for joint in range(1, JOINTS + 1)
                ]
    return pd.DataFrame(errors), pd.DataFrame(outcomes)


def body_tables():
    links, base = [], []
    for model in STRUCTURES:
        for seed in range(SEEDS):
            possible = model in ("tri", "cov")
            for number, name in enumerate(iiwa().tree.names):
                row = {"model": model, "loss": "raw", "seed": seed, "link": name}
                row |= {"mass_kg": 1.5 * (number + 1.0), "true_mass_kg": number + 1.0}
                row |= {f"{prefix}centre_{axis}_m": 0.1 for prefix in ("", "true_") for axis in "xyz"}
                row |= {
                    f"{prefix}moment_{place}_kg_m2": 0.01 for prefix in ("", "true_") for place in (1, 2, 3)
                }
                row |= {"positive_mass": True, "positive_definite": model != "nostr", "triangle": possible}
                links.append(row)
            for name, truth in (("hx[a]", 0.001), ("Izz[a]", 0.02), ("m[b]", 2.0)):
                row = {"model": model, "loss": "raw", "seed": seed, "parameter": name}
                base.append(row | {"truth": truth, "value": 1.01 * truth})
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
            for seed in range(SEEDS):
                for task in ("sine", "reach"):
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
    rows = [
        (model, loss, seed, batch, joint, (100.0 if model in ("spd", "tri", "cov") else 1000.0) * 0.8**batch)
        for model in KINDS
        for loss in LOSSES
        for seed in range(SEEDS)
        for batch in range(12)
        for joint in range(1, JOINTS + 1)
    ]
    return pd.DataFrame(rows, columns=["model", "loss", "seed", "batch", "joint", "nmse"])


def payload_table(settled_after=3.0):
    """A payload of 1.5 kg from 120 s on, whose learned mass is right after some time."""
    time = np.arange(1.0, 241.0)
    mass = np.where(time <= 120.0, 0.0, np.where(time <= 120.0 + settled_after, 0.7, 1.49))
    moments = {f"moment_{axis}_kg_m": 0.1 * mass * (axis == "z") for axis in "xyz"}
    errors = {"nmse_fixed": np.where(time <= 120.0, 1e-7, 0.6), "nmse_learned": np.full(len(time), 1e-4)}
    return pd.DataFrame({"time_s": time, **errors, "mass_kg": mass, **moments})


def known_table():
    rows = [
        (model, joint, error)
        for model, error in ((GROUND_TRUTH, 0.003), (DEFAULT, 0.3))
        for joint in range(1, JOINTS + 1)
    ]
    return pd.DataFrame(rows, columns=["model", "joint", "nmse"])


def friction_rows():
    rows = []
    for model, terms in (("cov", ("viscous",)), (f"cov{COULOMB}", ("viscous", "coulomb"))):
        for seed in range(SEEDS):
            for joint in range(1, JOINTS + 1):
                factor = 4.0 if model == "cov" else 1.1
                rows += [(model, seed, joint, term, factor * 0.5, 0.5) for term in terms]
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


def recorded_results(consistent=1.2, coulomb=0.01):
    """Errors on a recorded arm: of bodies that can exist `consistent` times those of least squares."""
    factors = {recorded.LEAST_SQUARES: 1.0, "nostr": 1.0, "symm": 1.0} | dict.fromkeys(
        ("spd", "tri", "cov"), consistent
    )
    frictions = {"viscous": 0.05, "coulomb": coulomb, "offset": 0.8 * coulomb}
    models = [("urdf", "none", 4.0), ("mlp", "none", 0.1), ("mlp_scaled", "none", 0.07)]
    models += [("delan", "viscous", 30.0), ("delan", "coulomb", 30.0)]
    models += [
        (model, friction, factor * error)
        for friction, error in frictions.items()
        for model, factor in factors.items()
    ]
    joints = np.arange(1, JOINTS + 1)
    errors = [
        {"model": model, "friction": friction, "seed": 0, "part": part, "joint": joint, "nmse": share * error}
        for model, friction, error in models
        for part, share in (("train", 0.5), ("test", 1.0))
        for joint in joints
    ]
    time = np.arange(0.0, 4.0, 0.1)
    traces = pd.DataFrame({"time_s": np.tile(time, JOINTS), "joint": np.repeat(joints, len(time))})
    for model, friction, error in models:
        name = model if friction == "none" else f"{model}_{friction}"
        traces[name] = np.sin(traces["time_s"]) + error
    rubbing = [("cov", "coulomb", joint, term, 0.3) for joint in joints for term in ("viscous", "coulomb")]
    columns = ["model", "friction", "joint", "term", "value"]
    return recorded.RecordedDynamicsResults(
        errors=pd.DataFrame(errors),
        friction=pd.DataFrame(rubbing, columns=columns),
        links=body_tables()[0].assign(friction="coulomb"),
        traces=traces.assign(measured=np.sin(traces["time_s"])),
    )


def slide_tables():
    torques = [
        (sign, fitted, joint, 5.0, 5.0, left)
        for sign, left in ((1, 8.0), (-1, 1.2))
        for fitted in (False, True)
        for joint in range(1, JOINTS + 1)
    ]
    centre = dict.fromkeys(("centre_x_m", "centre_y_m", "centre_z_m"), 0.1)
    payloads = pd.DataFrame({"sign": [1, -1], "mass_kg": [-11.8, 2.4], **centre})
    columns = ["sign", "payload", "joint", "measured_n_m", "model_n_m", "left_n_m"]
    return pd.DataFrame(torques, columns=columns), payloads
