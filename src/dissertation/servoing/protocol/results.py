"""Results of the servoing testbed: one value per person, see `dissertation.evidence.results`.

Errors are means over the seeds of a person's models, on test contacts unless `split` says otherwise; numbers
of targets are sums over these models. Quantities:

    reconstruction_nmse, worst_electrode_nmse, distances_nmse, pressure_nmse
                     of a latent `space`, by `split`
    prediction_nmse  of chained predictions, by forward `model`, `loss` trained with, `steps` and `part`: of
                     the latent state (`latent`; `plane`, its first two numbers, and `third`), or decoded
                     (`pressure`, `electrodes`)
    cosine_distance  between an action and that of an inverse `model`, by `target`: the latent state that
                     `followed` or that was `predicted`; `agreement` compares the actions for both
    reached, trials  numbers of targets, by `controller`, inverse `model`, `change`, `skin` and kind of
                     `target`; `steps`: its horizon
    near, lost       of these trials: number in which the contact ended within the tolerated distance,
                     whatever the pressure; and in which it was lifted or left the skin
    log_contact_s, log_contact_n, log_error_mm
                     logarithms of time and mean load of demonstrated contacts, and of the distance from the
                     target where the adaptive controller with NJ ends: sums for `variance_shares`
"""

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from dissertation.evidence.results import joined_results, long_table
from dissertation.evidence.variance_shares import trial_sums
from dissertation.servoing.protocol.servo_scores import rows_of
from dissertation.servoing.protocol.servo_variants import ADAPTIVE, SPACES, ServoVariant
from dissertation.simulation.touch_demonstrator import APPROACH_S
from structlearn.tactile.latent_parameters import JACOBIAN, NO_INVERSE

WORDS = ("skin", "space", "model", "loss", "controller", "change", "split", "part", "target")
KEYS: dict[str, type] = {"person": int, "steps": float} | dict.fromkeys(WORDS, str)

STRUCTURED = SPACES[True]
TARGETS = {"encoder": "followed", "forward": "predicted", "agreement": "agreement"}
ALL = "all"  # kinds of targets in closed loop
OWN = "own"  # skin that was demonstrated on first; others have their names

DEMONSTRATED, TRAINED, SERVOED = "servoing_record_touch", "servoing_train_latent", "servoing_servo"  # stages


NAMES = {"form": "controller", "horizon": "steps", "forward": "model", "inverse": "model"}
NAMES |= {"trained_with": "loss", "comparison": "target", "motion": "target"}
"""Keys by the column of the evaluating stages' tables."""


def servoing_results(
    person: int,
    tolerated_mm: float,
    truth: pd.DataFrame,
    models: Mapping[str, pd.DataFrame],
    loops: Mapping[str, pd.DataFrame],
) -> pd.DataFrame:
    """Table of results of one person, with a tolerated distance from targets.

    `truth`: `touch_demonstrator.true_contacts` of all demonstrations; `models`: tables of
    `tactile.latent_comparison.LatentComparison`; `loops`: `trials` of `protocol.servo_trials.compare`, and
    `other_skins`, the same with a column `skin`.
    """
    trials = pd.concat([loops["trials"].assign(skin=OWN), loops["other_skins"]], ignore_index=True)
    parts = [
        *_of_models(models),
        *_of_loops(trials.assign(near=trials["position_error_mm"] <= tolerated_mm)),
        *_of_trials(person, contacts(truth), loops["trials"]),
    ]
    return joined_results([part.assign(person=person) for part in parts], KEYS)


def contacts(truth: pd.DataFrame) -> pd.DataFrame:
    """Contacts of `touch_demonstrator.true_contacts`: `motion`, `area`, `contact_s`, mean load `contact_n`.

    A finger that is off the handle for less than its approach takes has only slackened.
    """
    touched = truth[truth["load_n"] > 0]
    first = (touched["trial"] != touched["trial"].shift()) | (touched["time_s"].diff() > APPROACH_S)
    by = touched.groupby(first.cumsum())
    motion_and_area = by["trial"].first().str.extract(r"(?P<motion>\w+)_(?P<area>\d+)_\d+$")
    lasted = by["time_s"].last() - by["time_s"].first()
    return motion_and_area.assign(contact_s=lasted, contact_n=by["load_n"].mean())


def keyed(table: pd.DataFrame) -> pd.DataFrame:
    """A table of the evaluating stages with the columns and values of the table of results."""
    table = table.assign(space=table["structure"].map(SPACES)).drop(columns="structure")
    if "with_loss" in table:
        table = table.assign(loss=table["inverse"].where(table["with_loss"], NO_INVERSE))
    if "comparison" in table:
        table = table.assign(comparison=table["comparison"].map(TARGETS))
    return table.rename(columns=NAMES)


def controller_keys(variant: ServoVariant) -> dict[str, object]:
    """Keys of a controller in the table of results."""
    return {
        "controller": variant.form,
        "model": variant.inverse,
        "space": SPACES[variant.structure],
        "loss": variant.inverse if variant.with_loss else NO_INVERSE,
        "steps": variant.horizon,
        "change": variant.change,
    }


def prediction_errors(models: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """NMSE of chained predictions by seed, with a column for every `part`."""
    keys = ["structure", "seed", "forward", "trained_with", "steps"]
    return keyed(models["forward"].merge(models["decoded"], on=keys).rename(columns={"nmse": "latent"}))


def _of_models(models: Mapping[str, pd.DataFrame]) -> Iterator[pd.DataFrame]:
    spaces = keyed(models["latent"]).groupby(["space", "split"], sort=False).mean().drop(columns="seed")
    for name in spaces:
        yield long_table(TRAINED, f"{name}_nmse", spaces[name])
    errors = prediction_errors(models).groupby(["space", "model", "loss", "steps"], sort=False).mean()
    for part in errors.columns.drop("seed"):
        yield long_table(TRAINED, "prediction_nmse", errors[part], part=part)
    directions = keyed(models["directions"]).groupby(["space", "model", "loss", "target"], sort=False)
    yield long_table(TRAINED, "cosine_distance", directions["distance"].mean())


def _of_trials(person: int, touches: pd.DataFrame, trials: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Rows from which the share of the variance between people is found."""
    ended = rows_of(trials, ServoVariant(ADAPTIVE, JACOBIAN))
    for stage, table, column, groups in (
        (DEMONSTRATED, touches, "contact_s", ["motion", "area"]),
        (DEMONSTRATED, touches, "contact_n", ["motion", "area"]),
        (SERVOED, ended, "position_error_mm", ["motion"]),
    ):
        name = f"log_{column.removeprefix('position_')}"
        its = table[groups].assign(person=person, **{name: np.log(table[column])})
        yield from trial_sums(stage, name, its, "person", groups)


def _of_loops(trials: pd.DataFrame) -> Iterator[pd.DataFrame]:
    keys = ["skin", *controller_keys(ServoVariant("", "NJ"))]
    lost = trials["lifted"] | trials["off_skin"]
    counted = keyed(trials).assign(reached=trials["success"], trials=1, lost=lost)
    for name in ("reached", "trials", "near", "lost"):
        whole, by_kind = (counted.groupby(by, sort=False)[name].sum() for by in (keys, [*keys, "target"]))
        yield long_table(SERVOED, name, whole, "targets", target=ALL)
        yield long_table(SERVOED, name, by_kind, "targets")
