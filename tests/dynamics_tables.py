"""Made-up results of the dynamics stages, as their tables are."""

from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pybullet_data
from committed import committed

from dissertation.dynamics.names import IDEAL, ROBOT
from dissertation.dynamics.page import findings as page_findings
from dissertation.dynamics.page.page import Raw, pick_up_s
from dissertation.dynamics.protocol.results import dynamics_results
from dissertation.dynamics.protocol.tracking import KNOWN, TrackingParameters
from dissertation.dynamics.protocol.training_choice import SEEDS as TRIED
from dissertation.dynamics.protocol.trainings import (
    CHOSEN,
    FORMS,
    PART,
    PLAIN,
    DynamicsTrainingParameters,
    OnlineParameters,
)
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import PerturbedRobotParameters, RecordMotionParameters
from dissertation.evidence.results import Population, Results
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.dynamics_training import KINDS, LOSSES
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH
from structlearn.rigid_body.robot import Robot, read_urdf

SEEDS, JOINTS = (11, 12, 13), 7
"""Of models in simulation, and of robots."""

EPOCHS = {"mlp": 20, "mlp_scaled": 4, "delan": 40, "nostr": 12, "symm": 6, "spd": 2, "tri": 2, "cov": 2}
"""After which a model is good enough in simulation; with the plain loss networks never are."""

VELOCITY = {GROUND_TRUTH: 0.01, "mlp": 5.0, "delan": 0.3, "nostr": 0.05}
"""NMSE of the tool's velocity in simulation; of other models as of the ground truth."""

IIWA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"


@lru_cache
def iiwa() -> Robot:
    return read_urdf(IIWA)


def trainings():
    """Keys of all trainings, epochs to the threshold (NaN: not reached), final NMSE, and what was met."""
    found = []
    for kind, form in product(KINDS, FORMS):
        structured = kind in STRUCTURES
        if kind == "mlp_scaled" and form == PLAIN:
            continue
        learned = structured or form == CHOSEN
        if form == CHOSEN:
            found.append((PART, kind, form, 10.0 * EPOCHS[kind], 0.03 if structured else 0.7, True))
        found.append(
            (IDEAL, kind, form, EPOCHS[kind] if learned else np.nan, 0.05 if learned else 0.8, learned)
        )
        for name in (kind, f"{kind}{COULOMB}") if structured else (kind,):
            error = 0.004 if name != kind else 0.03 if structured else 0.05 if learned else 4.0
            found.append((ROBOT, name, form, 1.0, error, learned))
    return found


def training_tables():
    errors, outcomes = [], []
    names = ["arm", "model", "form"]
    for (*key, reached, error, met), (place, seed) in product(trainings(), enumerate(SEEDS)):
        last = 15 if np.isnan(reached) else int(reached)
        keys = dict(zip(names, key, strict=True)) | {"seed": seed}
        final = error * (1.0 + 0.1 * place)
        outcome = {"epochs": reached, "epochs_but_last": 1.0, "nmse_mean": final, "nmse_max": 2.0 * final}
        outcomes.append(keys | outcome | {"met": met})
        for epoch, joint in product(range(last + 1), range(1, JOINTS + 1)):
            nmse = final if epoch == last else 100.0
            errors.append(keys | {"epoch": epoch, "joint": joint, "nmse": nmse})
    return pd.DataFrame(errors), pd.DataFrame(outcomes)


def body_tables():
    links, base = [], []
    centres = {f"{prefix}centre_{axis}_m": 0.1 for prefix in ("", "true_") for axis in "xyz"}
    moments = {f"{prefix}moment_{place}_kg_m2": 0.01 for prefix in ("", "true_") for place in "123"}
    for model, seed in product(STRUCTURES, SEEDS):
        keys = {"model": model, "form": CHOSEN, "seed": seed}
        kept = {"positive_definite": model != "nostr", "triangle": model in ("tri", "cov")}
        for number, name in enumerate(iiwa().tree.names):
            masses = {"mass_kg": 1.5 * (number + 1.0), "true_mass_kg": number + 1.0, "positive_mass": True}
            links.append(keys | {"link": name} | masses | centres | moments | kept)
        for name, truth in (("hx[a]", 0.001), ("Izz[a]", 0.02), ("m[b]", 2.0)):
            base.append(keys | {"parameter": name, "truth": truth, "value": 1.01 * truth})
    return pd.DataFrame(links), pd.DataFrame(base)


def tracking_tables():
    """Scores of models that met the criterion, and reaches of one seed, in which a worse model lags more."""
    scores, paths = [], []
    time = np.arange(0.0, 2.0, 0.04)
    known = [(IDEAL, GROUND_TRUTH, KNOWN), (ROBOT, GROUND_TRUTH, KNOWN), (ROBOT, DEFAULT, KNOWN)]
    learned = [(arm, model, form) for arm, model, form, *_, met in trainings() if met and arm != PART]
    for robot, model, form in known + learned:
        if model.endswith(COULOMB) and model != f"cov{COULOMB}":
            continue
        stopped = "speed limit" if (robot, model) == (ROBOT, "delan") else ""
        score = VELOCITY.get(model, 0.01)
        end = 10 if stopped else len(time)
        for (place, seed), task in product(enumerate(SEEDS), ("sine", "reach")):
            numbers = {"position_nmse": 0.005, "velocity_nmse": score * (1.0 + 0.1 * place)}
            numbers["feedback_share"] = (0.3 if model == DEFAULT else 0.1) if task == "sine" else np.nan
            numbers["acceleration_error_m_s2"] = 10.0 * score if task == "reach" else np.nan
            key = {"robot": robot, "model": model, "form": form, "seed": seed, "task": task}
            halted = {"stopped": stopped if task == "reach" else "", "duration_s": time[end - 1]}
            scores.append(key | numbers | halted)
        keys = {"robot": robot, "model": model, "form": form, "task": "reach"}
        path = pd.DataFrame(keys | {"time_s": time[:end]})
        for name in iiwa().tree.names:
            path[name] = 0.2 * time[:end]
        for axis in "xyz":
            path[f"wanted_{axis}"] = 0.4 + 0.1 * np.sin(time[:end])
            path[f"tool_{axis}"] = path[f"wanted_{axis}"] + 0.01 * score
        paths.append(path)
    return pd.DataFrame(scores), pd.concat(paths, ignore_index=True)


def online_table():
    """The strict structures learn ten times as fast as all others."""
    start = dict.fromkeys(KINDS, 5.0) | dict.fromkeys(("spd", "tri", "cov"), 0.5)
    keys = product(KINDS, LOSSES, SEEDS, range(12), range(1, JOINTS + 1))
    table = pd.DataFrame(keys, columns=["model", "loss", "seed", "batch", "joint"])
    return table.assign(nmse=table["model"].map(start) * 0.8 ** table["batch"])


def payload_table(settled_after=3.0):
    """A payload of 1.5 kg from 30 s on, whose learned mass is right after some time, on every robot."""
    time = np.arange(1.0, 61.0)
    mass = np.where(time <= 30.0, 0.0, np.where(time <= 30.0 + settled_after, 0.7, 1.49))
    moments = {f"moment_{axis}_kg_m": 0.1 * mass * (axis == "z") for axis in "xyz"}
    errors = {"nmse_fixed": np.where(time <= 30.0, 1e-7, 0.6), "nmse_learned": np.full(len(time), 1e-4)}
    columns = {"time_s": time, **errors, "mass_kg": mass, **moments}
    return pd.concat([pd.DataFrame(columns | {"seed": seed}) for seed in SEEDS], ignore_index=True)


def known_table():
    rows = product(((GROUND_TRUTH, 0.003), (DEFAULT, 0.3)), range(1, JOINTS + 1), SEEDS)
    rows = [(model, joint, error, seed) for (model, error), joint, seed in rows]
    return pd.DataFrame(rows, columns=["model", "joint", "nmse", "seed"])


def friction_rows():
    rows = []
    for model, terms in (("cov", ("viscous",)), (f"cov{COULOMB}", ("viscous", "coulomb"))):
        value = 2.0 if model == "cov" else 0.55
        keys = product([model], SEEDS, range(1, JOINTS + 1), terms)
        rows += [(*key, value, 0.5) for key in keys]
    return pd.DataFrame(rows, columns=["model", "seed", "joint", "term", "value", "truth"])


def residual_table():
    speed = np.tile(np.linspace(-1.0, 1.0, 20), JOINTS)
    friction = 0.5 * np.sign(speed)
    joints = np.repeat(np.arange(1, JOINTS + 1), 20)
    columns = {"velocity_rad_s": speed, "residual_n_m": 1.1 * friction, "friction_n_m": friction}
    return pd.DataFrame({"joint": joints, **columns})


def choice_table():
    """The normalised loss is the better one."""
    keys = product(KINDS, LOSSES, (256, 64), (0.003, 0.01), TRIED)
    table = pd.DataFrame(keys, columns=["model", "loss", "batch", "rate", "seed"])
    return table.assign(epochs=np.where(table["loss"] == "raw", np.nan, 300.0 * table["rate"]), nmse_max=0.09)


def dynamics_tables() -> Raw:
    """All that the page is made from."""
    errors, outcomes = training_tables()
    links, base = body_tables()
    scores, paths = tracking_tables()
    agreement = {"largest_n_m": 90.0, "regressor_n_m": 3e-13, "compiled_n_m": 2e-14}
    return {
        "errors": errors,
        "outcomes": outcomes,
        "links": links,
        "base": base,
        "known": known_table(),
        "friction": friction_rows(),
        "scores": scores,
        "paths": paths,
        "online": online_table(),
        "payload": payload_table(),
        "agreement": pd.DataFrame([{"robot": name} | agreement for name in ("one", "two", "three")]),
        "residuals": residual_table(),
        "choice": choice_table(),
    }


@lru_cache
def parameters():
    """Those of the page, by key."""
    return {
        "perturbed_robot": committed(PerturbedRobotParameters, "perturbed_robot"),
        "arm_motion": committed(ArmMotionParameters, "arm_motion"),
        "train_dynamics": committed(DynamicsTrainingParameters, "train_dynamics", seeds=SEEDS),
        "online": committed(OnlineParameters, "online", seeds=SEEDS),
        "track": committed(TrackingParameters, "track"),
        "record_motion": committed(RecordMotionParameters, "record_motion"),
    }


def population_of(tables: Raw) -> Population:
    """Results of this run, without a study."""
    chosen = parameters()
    limits, payload = chosen["train_dynamics"].epochs, chosen["record_motion"].payload
    own = Results(dynamics_results(tables, limits, payload.mass_kg, pick_up_s(chosen)), "seed")
    return Population(own, own, None)


def findings_of(tables: Raw) -> Findings:
    differences = tables["agreement"][["regressor_n_m", "compiled_n_m"]].max(axis=1)
    return page_findings.findings(population_of(tables), differences)
