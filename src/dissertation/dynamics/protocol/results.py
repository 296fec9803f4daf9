"""Results of the dynamics testbed: one long table by seed, which in robots' rows is also that of the robot.

From `dynamics_train`, by arm, model and form (none: not learned):
    epochs, epochs_but_last    to the criterion, at most the limit; without the last joint
    reached, met               1 or 0: within the limit; the text's criterion, see `trainings.train_all`
    nmse                       of torques, mean over joints
    links, consistent_links    number, of the first arm
    viscous_ratio, coulomb_ratio, viscous_error, coulomb_error
                               learned friction over the true one, and its distance from 1; median over joints
    viscous_true, coulomb_true that of a robot, median over joints (N m s/rad, N m)
From `dynamics_online`, by model and loss:
    online_course, online_half, online_final
                               NMSE: geometric mean over the batches, in the middle, at the end
    payload_mass_error         relative, over the second half of the payload's time
    payload_settled, payload_settling
                               1 or 0: the mass stays correct; s until then
    payload_nmse               on batches not yet learned from (model `fixed` or `learned`)
From `dynamics_track`, by arm, model, form and task:
    position_nmse, velocity_nmse, stopped (1 or 0)
                               a stopped run has an NMSE of at least `STOPPED_NMSE`
    feedback_share, acceleration_error (m/s^2)
                               of sines that were not stopped; of reaches, until stopped
"""

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from dissertation.dynamics.protocol.forms import CHOSEN, EpochLimits
from dissertation.evidence.results import joined_results, long_table
from structlearn.rigid_body.model_names import ROBOT

KEYS = {"seed": int, "arm": str, "model": str, "form": str, "loss": str, "task": str}

STOPPED_NMSE = 1.0  # least error counted for a stopped run: that of an arm that does not move
SETTLED_SHARE = 0.1  # relative error of a payload's mass within which it counts as correct

FRICTION_UNITS = {"viscous": "N m s/rad", "coulomb": "N m"}

CONDITIONS = ["positive_mass", "positive_definite", "triangle"]
"""Conditions of physical consistency: columns of `base_parameters.link_table`."""


def dynamics_results(
    tables: Mapping[str, pd.DataFrame], limits: EpochLimits, mass_kg: float, pick_up_s: float
) -> pd.DataFrame:
    """Table of results.

    Args:
        tables: of the stages, see `files.TABLES`.
        limits: largest number of epochs.
        mass_kg: mass of the payload.
        pick_up_s: time of its pick-up.
    """
    errors = tables["known"].groupby(["seed", "model"])["nmse"].mean()
    parts = [
        *_trainings(tables["outcomes"], limits),
        long_table("dynamics_train", "nmse", errors, arm=ROBOT),
        *_bodies(tables["links"]),
        *_friction(tables["friction"]),
        *_online(tables["online"]),
        *_payload(tables["payload"], mass_kg, pick_up_s),
        *_tracking(tables["scores"]),
    ]
    return joined_results(parts, KEYS)


def _trainings(outcomes: pd.DataFrame, limits: EpochLimits) -> Iterable[pd.DataFrame]:
    its = outcomes.set_index(["seed", "arm", "model", "form"])
    most = np.where(its.index.get_level_values("arm") == ROBOT, limits.robot, limits.simulation)
    columns = {
        "epochs": its["epochs"].where(its["epochs"].notna(), most),
        "epochs_but_last": its["epochs_but_last"].dropna(),
        "reached": its["epochs"].notna(),
        "met": its["met"],
        "nmse": its["nmse_mean"],
    }
    return [long_table("dynamics_train", name, values) for name, values in columns.items()]


def _bodies(links: pd.DataFrame) -> Iterable[pd.DataFrame]:
    consistent = links[CONDITIONS].all(axis=1).groupby([links[key] for key in ("seed", "model", "form")])
    columns = {"links": consistent.size(), "consistent_links": consistent.sum()}
    return [long_table("dynamics_train", name, values) for name, values in columns.items()]


def _friction(table: pd.DataFrame) -> Iterable[pd.DataFrame]:
    keys = pd.MultiIndex.from_frame(table[["seed", "model", "term"]])
    ratios = (table["value"] / table["truth"]).set_axis(keys)
    for term, its in ratios.groupby("term"):
        for name, values in (("ratio", its), ("error", (its - 1.0).abs())):
            medians = values.groupby(["seed", "model"]).median()
            yield long_table("dynamics_train", f"{term}_{name}", medians, form=CHOSEN)
    once = table.drop_duplicates(["seed", "joint", "term"])  # of each model
    true = once.groupby(["term", "seed"])["truth"].median()
    for term, unit in FRICTION_UNITS.items():
        yield long_table("dynamics_train", f"{term}_true", true[term], unit)


def _online(errors: pd.DataFrame) -> Iterable[pd.DataFrame]:
    keys = ["seed", "model", "loss"]
    curves = errors.groupby([*keys, "batch"])["nmse"].mean().reset_index()
    last = curves["batch"].max()
    own = curves[curves["batch"] > 0].set_index(keys)
    columns = {
        "online_course": np.exp(np.log(own["nmse"]).groupby(keys).mean()),
        "online_half": own.loc[own["batch"] == last // 2, "nmse"],
        "online_final": own.loc[own["batch"] == last, "nmse"],
    }
    return [long_table("dynamics_online", name, values) for name, values in columns.items()]


def _payload(table: pd.DataFrame, mass_kg: float, pick_up_s: float) -> Iterable[pd.DataFrame]:
    after = table[table["time_s"] > pick_up_s]
    late = after[after["time_s"] > 0.5 * (pick_up_s + table["time_s"].max())]
    error = (late.groupby("seed")["mass_kg"].mean() / mass_kg - 1.0).abs()
    settling = after.groupby("seed")[["time_s", "mass_kg"]].apply(_settled_s, mass_kg) - pick_up_s
    yield long_table("dynamics_online", "payload_mass_error", error, "share")
    yield long_table("dynamics_online", "payload_settled", settling.notna())
    yield long_table("dynamics_online", "payload_settling", settling.dropna(), "s")
    for model in ("fixed", "learned"):
        errors = after.groupby("seed")[f"nmse_{model}"].mean()
        yield long_table("dynamics_online", "payload_nmse", errors, model=model)


def _settled_s(one: pd.DataFrame, mass_kg: float) -> float:
    """First time in s from which on the learned mass is correct; NaN if it never is."""
    wrong = (one["mass_kg"] - mass_kg).abs() > SETTLED_SHARE * mass_kg
    settled = one["time_s"][~wrong[::-1].cummax()[::-1]]
    return settled.iloc[0] if len(settled) else np.nan


def _tracking(scores: pd.DataFrame) -> Iterable[pd.DataFrame]:
    its = scores.rename(columns={"robot": "arm"}).set_index(["seed", "arm", "model", "form", "task"])
    stopped = its["stopped"] != ""
    for name in ("position_nmse", "velocity_nmse"):
        counted = its[name].where(~stopped, its[name].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE))
        yield long_table("dynamics_track", name, counted)
    yield long_table("dynamics_track", "stopped", stopped)
    yield long_table("dynamics_track", "feedback_share", its["feedback_share"].dropna())
    errors = its["acceleration_error_m_s2"].dropna()
    yield long_table("dynamics_track", "acceleration_error", errors, "m/s^2")
