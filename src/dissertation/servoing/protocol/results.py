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
"""

from collections.abc import Iterator, Mapping

import pandas as pd

from dissertation.evidence.results import joined_results, long_table
from dissertation.servoing.protocol.servo_variants import SPACES, ServoVariant
from structlearn.tactile.latent_parameters import NO_INVERSE

WORDS = ("skin", "space", "model", "loss", "controller", "change", "split", "part", "target")
KEYS: dict[str, type] = {"person": int, "steps": float} | dict.fromkeys(WORDS, str)

STRUCTURED = SPACES[True]
TARGETS = {"encoder": "followed", "forward": "predicted", "agreement": "agreement"}
ALL = "all"  # kinds of targets in closed loop
OWN = "own"  # skin that was demonstrated on first; others have their names

TRAINED, SERVOED = "servoing_train_latent", "servoing_servo"  # stages


NAMES = {"form": "controller", "horizon": "steps", "forward": "model", "inverse": "model"}
NAMES |= {"trained_with": "loss", "comparison": "target", "motion": "target"}
"""Keys by the column of the evaluating stages' tables."""


def servoing_results(
    person: int, tolerated_mm: float, models: Mapping[str, pd.DataFrame], loops: Mapping[str, pd.DataFrame]
) -> pd.DataFrame:
    """Table of results of one person, with a tolerated distance from targets.

    `models`: tables of `tactile.latent_comparison.LatentComparison`; `loops`: `trials` of
    `protocol.servo_trials.compare`, and `other_skins`, the same with a column `skin`.
    """
    trials = pd.concat([loops["trials"].assign(skin=OWN), loops["other_skins"]], ignore_index=True)
    parts = [*_of_models(models), *_of_loops(trials.assign(near=trials["position_error_mm"] <= tolerated_mm))]
    return joined_results([part.assign(person=person) for part in parts], KEYS)


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


def _of_loops(trials: pd.DataFrame) -> Iterator[pd.DataFrame]:
    keys = ["skin", *controller_keys(ServoVariant("", "NJ"))]
    lost = trials["lifted"] | trials["off_skin"]
    counted = keyed(trials).assign(reached=trials["success"], trials=1, lost=lost)
    for name in ("reached", "trials", "near", "lost"):
        whole, by_kind = (counted.groupby(by, sort=False)[name].sum() for by in (keys, [*keys, "target"]))
        yield long_table(SERVOED, name, whole, "targets", target=ALL)
        yield long_table(SERVOED, name, by_kind, "targets")
