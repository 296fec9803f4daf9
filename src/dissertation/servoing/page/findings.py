"""Findings on tactile servoing, for the page's sentences and claims.

They are about people: each has demonstrations, a sensor, models and trials of their own. Seeds of one
person's models are not independent samples, so values per person are means or sums over them. The people are
those of the study `servoing/people`; the person of this run is shown in figures, and counts alone where the
study has nothing.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.results import Register, Results, with_study
from dissertation.evidence.studies import Study
from dissertation.evidence.variance_shares import between_share, sums_of
from dissertation.servoing.names import AS_PUBLISHED, DYNAMICS, OURS, SKIN_NAMES, dynamics_name
from dissertation.servoing.protocol.results import ALL, OWN, STRUCTURED, controller_keys
from dissertation.servoing.protocol.servo_variants import SPACES, ServoVariant
from structlearn.reporting.evidence import (
    Evidence,
    clustered_share,
    exact,
    geometric_mean,
    mean,
    rate_difference,
)
from structlearn.reporting.findings import Findings
from structlearn.tactile.latent_parameters import FORWARD_OF, JACOBIAN, LOCALLY_LINEAR, NO_INVERSE
from structlearn.tactile.touch_dataset import SPLITS

PEOPLE_STUDY = "servoing/people"  # the study behind the verdicts
TEST_CHAIN = 3  # prediction steps at which forward models are compared; they are trained on two (II.4.4)
UNSTRUCTURED = SPACES[False]
AS_PUBLISHED_LL = replace(AS_PUBLISHED, inverse=LOCALLY_LINEAR)  # the dissertation did not run it on a robot
OTHER_SKINS = [skin for skin in SKIN_NAMES if skin != "biotac"]
WITH_LOSS = [kind for kind in DYNAMICS if kind[1] != NO_INVERSE]

register = Register()
finding = register.finding


def findings(own: pd.DataFrame, study: Study | None) -> Findings:
    """All findings, from the results of this run and of the study."""
    find = Findings("people", PEOPLE_STUDY)
    register.evaluate(find, with_study(own, study, "person", tested=()))
    return find


def predicted(
    results: Results,
    kind: tuple[str, str],
    space: str = STRUCTURED,
    steps: int = TEST_CHAIN,
    part: str = "latent",
) -> pd.Series:
    """NMSE by person of one of `DYNAMICS`."""
    return results.each("prediction_nmse", model=kind[0], loss=kind[1], space=space, steps=steps, part=part)


def directed(results: Results, inverse: str, loss: str = "", target: str = "followed") -> pd.Series:
    """Cosine distance by person of an inverse model, by default trained with its own loss."""
    return results.each(
        "cosine_distance", model=inverse, loss=loss or inverse, space=STRUCTURED, target=target
    )


def targets(
    results: Results, variant: ServoVariant, skin: str = OWN, target: str = ALL, quantity: str = "reached"
) -> pd.DataFrame:
    """Numbers of `hits` and `trials` of a controller, by person."""
    keys = controller_keys(variant) | {"skin": skin, "target": target}
    return pd.DataFrame(
        {"hits": results.each(quantity, **keys), "trials": results.each("trials", **keys)}
    ).dropna()


def paired(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Two tables of `targets` side by side, of the people that both have."""
    return pd.concat([first, second], axis=1, keys=["first", "second"], join="inner")


def of_all_models(results: Results, form: ServoVariant, **changes: Any) -> pd.DataFrame:
    """Sum of `targets` over the three inverse models."""
    variants = [replace(form, inverse=inverse, **changes) for inverse in FORWARD_OF]
    return sum((targets(results, one) for one in variants[1:]), targets(results, variants[0]))


def share(counts: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Share of targets, from `targets`."""
    return clustered_share(counts["hits"], counts["trials"], comparisons)


def points(pairs: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Difference of two shares in percentage points, from `paired`."""
    first, second = (
        (pairs[side, "hits"].to_numpy(), pairs[side, "trials"].to_numpy()) for side in ("first", "second")
    )
    return rate_difference(first, second, comparisons)


@finding(exact, headline=True)
def people(results: Results) -> int:
    """People that the findings are about."""
    return int(results.table["person"].nunique())


@finding(between_share, unit="of the variance")
def between_people(results: Results) -> dict[str, pd.DataFrame]:
    """Share between people of the logs of contacts' time and load, and of errors in closed loop."""
    cases = {"time": "log_contact_s", "load": "log_contact_n", "error": "log_error_mm"}
    return {case: sums_of(results, quantity) for case, quantity in cases.items()}


@finding(geometric_mean, unit="NMSE", headline=("test",))
def people_reconstruction_nmse(results: Results) -> dict[str, pd.Series]:
    """Reconstruction of electrodes (II.4.2)."""
    return {split: results.each("reconstruction_nmse", space=STRUCTURED, split=split) for split in SPLITS}


@finding(geometric_mean, unit="NMSE", headline=("test",))
def people_mds_nmse(results: Results) -> dict[str, pd.Series]:
    """Latent distances against geodesics (II.4.3)."""
    return {split: results.each("distances_nmse", space=STRUCTURED, split=split) for split in SPLITS}


@finding(geometric_mean, unit="NMSE", headline=("latent with structure",))
def people_prediction_nmse(results: Results) -> dict[str, pd.Series]:
    """Predictions of NL trained with NJ's loss."""
    parts = ("latent", "plane", "third", "pressure", "electrodes")
    return {
        f"{part} with {space}": predicted(results, ("NL", "NJ"), space, part=part)
        for part in parts
        for space in SPACES.values()
    }


@finding(geometric_mean, unit="times the NMSE one step before")
def grows(results: Results) -> dict[str, pd.Series]:
    """Smallest rise of the prediction error from one step to the next, over all models of a person."""

    def smallest(space: str) -> pd.Series:
        steps = range(1, TEST_CHAIN)
        rises = [
            predicted(results, kind, space, step + 1) / predicted(results, kind, space, step)
            for kind in DYNAMICS
            for step in steps
        ]
        return pd.concat(rises, axis=1).min(axis=1, skipna=False)

    return {space: smallest(space) for space in SPACES.values()}


def without_structure(results: Results, part: str) -> dict[str, pd.Series]:
    """Prediction error without structure, divided by that with it."""
    return {
        dynamics_name(*kind): predicted(results, kind, UNSTRUCTURED, part=part)
        / predicted(results, kind, part=part)
        for kind in DYNAMICS
    }


RATIO = "times the NMSE with structure"
finding(geometric_mean, RATIO, name="structure_predicts")(partial(without_structure, part="latent"))
finding(geometric_mean, RATIO, name="structure_predicts_pressure")(
    partial(without_structure, part="pressure")
)


@finding(geometric_mean, unit="times the NMSE without the loss")
def loss_predicts_each(results: Results) -> dict[str, pd.Series]:
    """Prediction error with an inverse model's loss, divided by that without it."""
    return {
        dynamics_name(*kind): predicted(results, kind) / predicted(results, (kind[0], NO_INVERSE))
        for kind in WITH_LOSS
    }


@finding(geometric_mean, unit="times the NMSE without the loss, mean of the three models")
def loss_predicts(results: Results) -> pd.Series:
    """The same, geometric mean of the three models of a person."""
    logs = [np.log(ratio) for ratio in loss_predicts_each(results).values()]
    return np.exp(sum(logs[1:], logs[0]) / len(logs))


@finding(mean, headline=("NJ",))
def people_cosine_distance(results: Results) -> dict[str, pd.Series]:
    """Actions towards the latent state that followed (figure II.5)."""
    return {name: directed(results, name) for name in FORWARD_OF}


def beside_nj(results: Results, target: str) -> dict[str, pd.Series]:
    """Cosine distance of the other inverse models minus that of NJ."""
    nj = directed(results, JACOBIAN, target=target)
    return {name: directed(results, name, target=target) - nj for name in FORWARD_OF if name != JACOBIAN}


MORE = "more in cosine distance than NJ"
finding(mean, MORE, name="nj_predicts")(partial(beside_nj, target="followed"))
finding(mean, MORE, name="nj_agrees")(partial(beside_nj, target="agreement"))


@finding(mean, unit="more in cosine distance without the loss")
def loss_directs(results: Results) -> pd.Series:
    """What NJ's actions lose without its loss."""
    return directed(results, JACOBIAN, NO_INVERSE) - directed(results, JACOBIAN)


@finding(mean, unit="in cosine distance", headline=True)
def loss_needed(results: Results) -> pd.Series:
    """NJ's actions without its loss."""
    return directed(results, JACOBIAN, NO_INVERSE)


@finding(mean, unit="less in cosine distance towards the predicted state")
def easier_each(results: Results) -> dict[str, pd.Series]:
    """How much nearer actions are towards the predicted state than towards the one that followed."""
    return {
        name: directed(results, name) - directed(results, name, target="predicted") for name in FORWARD_OF
    }


@finding(mean, unit="less in cosine distance towards the predicted state, mean of the three models")
def easier(results: Results) -> pd.Series:
    """The same, mean of the three models of a person."""
    each = list(easier_each(results).values())
    return sum(each[1:], each[0]) / len(each)


def rates(name: str, variant: ServoVariant, headline: bool = False, **keys: Any) -> None:
    """Register a controller's share of targets."""
    finding(share, headline=headline, name=name)(partial(targets, variant=variant, **keys))


RATE = "people_servo_success_rate"
rates(RATE, OURS, headline=True)
rates(f"{RATE}_published", AS_PUBLISHED, headline=True)
rates(f"{RATE}_ll_published", AS_PUBLISHED_LL, headline=True)
rates(f"{RATE}_nostruct", replace(OURS, structure=False), headline=True)
rates("loss_needed_ll", replace(AS_PUBLISHED_LL, with_loss=False))
rates("people_servo_contacts_lost", OURS, quantity="lost")
rates("people_servo_contacts_lost_published", AS_PUBLISHED, quantity="lost")
for skin in OTHER_SKINS:
    rates(f"{RATE}_{skin}_published", AS_PUBLISHED, skin=skin)


def by_kind(
    results: Results, variant: ServoVariant, kinds: tuple[str, ...], quantity: str = "reached"
) -> dict[str, pd.DataFrame]:
    """Targets of a controller by kind."""
    return {kind: targets(results, variant, target=kind, quantity=quantity) for kind in kinds}


SHOWN_KINDS = ("rotation", "translation")  # of targets in figure II.6
finding(share, name="kinds_published")(partial(by_kind, variant=AS_PUBLISHED, kinds=SHOWN_KINDS))
finding(share, name="mixed_published")(partial(targets, variant=AS_PUBLISHED, target="mixed"))
finding(share, name="near_published")(
    partial(by_kind, variant=AS_PUBLISHED, kinds=SHOWN_KINDS, quantity="near")
)
finding(share, name="kinds")(partial(by_kind, variant=OURS, kinds=(*SHOWN_KINDS, "mixed")))


@finding(share, headline=True)
def geometry_aimed(results: Results) -> dict[str, pd.DataFrame]:
    """Targets of the adaptive controller on other skins."""
    return {SKIN_NAMES[skin]: targets(results, OURS, skin) for skin in OTHER_SKINS}


def other_skins(results: Results, variant: ServoVariant) -> dict[str, pd.DataFrame]:
    """Targets of a controller on other skins, and on the first."""
    own = targets(results, variant)
    return {SKIN_NAMES[skin]: paired(targets(results, variant, skin), own) for skin in OTHER_SKINS}


MORE_ON_SKIN = "percentage points more than on the first skin"
finding(points, MORE_ON_SKIN, name="geometry")(partial(other_skins, variant=AS_PUBLISHED))
finding(points, MORE_ON_SKIN, name="geometry_ll")(partial(other_skins, variant=AS_PUBLISHED_LL))


def gain(name: str, unit: str, form: ServoVariant, **without: Any) -> None:
    """Register what a form of controllers gains over those `without`: of each inverse model, and of all."""
    unit = f"percentage points more with {unit}"

    def each(results: Results) -> dict[str, pd.DataFrame]:
        variants = {inverse: replace(form, inverse=inverse) for inverse in FORWARD_OF}
        return {
            inverse: paired(targets(results, one), targets(results, replace(one, **without)))
            for inverse, one in variants.items()
        }

    finding(points, unit, name=f"{name}_each")(each)

    @finding(points, f"{unit}, mean of the three models", name=name)
    def of_all(results: Results) -> pd.DataFrame:
        return paired(of_all_models(results, form), of_all_models(results, form, **without))


gain("structure_serves", "structure", AS_PUBLISHED, structure=False)
gain("structure_serves_adaptive", "structure", OURS, structure=False)
gain("loss_serves", "the loss", OURS, with_loss=False)
