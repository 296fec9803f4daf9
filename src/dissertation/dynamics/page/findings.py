"""Findings on learned dynamics for the page's sentences and claims, as expressions on the testbed's results.

n counts seeds in simulation, and robots elsewhere; ratios are paired by seed. The chosen training decides the
dissertation's statements, the plain one (`protocol.trainings`) has rows of its own. Models that did not meet
the training criterion were not tracked, since the dissertation trained until it was met. Errors, epochs and
ratios of them are skewed, so their means are geometric.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.dynamics.names import IDEAL, REACH, ROBOT, SINE
from dissertation.dynamics.protocol.forms import CHOSEN, FORMS, PART, Form
from dissertation.dynamics.protocol.results import FRICTION_UNITS
from dissertation.dynamics.protocol.truth import FRICTION_MODELS
from dissertation.evidence.results import Population, Register, Results, Samples
from structlearn.core.params import read_values
from structlearn.reporting.evidence import (
    Evidence,
    exact,
    exact_count,
    geometric_mean,
    maximum,
    mean,
    minimum,
    share,
)
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.dynamics_training import LOSSES, Loss
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, STRICT, model_name

NETWORKS = ("mlp", "delan")  # published models without inertial parameters
LESS_STRICT = ("nostr", "symm")
RIVALS = (*NETWORKS, *LESS_STRICT)  # models less constrained than SPD, Tri and Cov
STRUCTURED = ("symm", *STRICT)  # on robots, as published

SEEDS, ROBOTS = Register(), Register()
"""Findings by population: of the arm as in its URDF, and of perturbed robots."""

SIMULATED = {"arm": IDEAL}
REACHING = {"task": REACH}


def by_form(register: Register, statistic: Callable[..., Evidence], **row: Any) -> Callable[..., Any]:
    """Decorator that registers a function of results and form once per form, as `<name>_<form>`."""

    def add(samples: Callable[..., Any]) -> Callable[..., Any]:
        for form in FORMS:
            one: Samples = partial(samples, form=form)
            register.finding(statistic, name=f"{samples.__name__}_{form}", **row)(one)
        return samples

    return add


def by_loss(statistic: Callable[..., Evidence], **row: Any) -> Callable[..., Any]:
    """Likewise for seeds and the losses of online learning."""

    def add(samples: Callable[..., Any]) -> Callable[..., Any]:
        for loss in LOSSES:
            one: Samples = partial(samples, loss=loss)
            SEEDS.finding(statistic, name=f"{samples.__name__}_{loss}", **row)(one)
        return samples

    return add


def named(scores: pd.DataFrame, models: Sequence[str]) -> dict[str, pd.Series | None]:
    """Samples of models by their printed names; None of those that were not run."""
    return {model_name(model): scores.get(model) for model in models}


def over(scores: pd.DataFrame, models: Sequence[str], references: Sequence[str]) -> dict[str, pd.Series]:
    """Scores of models over the geometric mean of the references' that were run, by seed."""
    there = [model for model in references if model in scores]
    reference = np.exp(np.log(scores[there]).mean(axis=1, skipna=False))
    return named(scores.reindex(columns=[*models]).div(reference, axis=0), models)


# --- the arm as in its URDF ---


@by_form(SEEDS, geometric_mean, unit="epochs", headline=("SPD", "Cov"))
def epochs(results: Results, form: Form) -> Any:
    """Epochs until every joint meets the criterion, at most the limit (table III.1)."""
    return named(results.wide("epochs", "model", **SIMULATED, form=form), STRICT)


@by_form(SEEDS, geometric_mean, unit="epochs")
def epochs_of_others(results: Results, form: Form) -> Any:
    """Likewise of less constrained models."""
    return named(results.wide("epochs", "model", **SIMULATED, form=form), ("mlp_scaled", *RIVALS))


@by_form(SEEDS, geometric_mean)
def epochs_more(results: Results, form: Form) -> Any:
    """Epochs of less constrained models over those of SPD, Tri and Cov."""
    return over(results.wide("epochs", "model", **SIMULATED, form=form), RIVALS, STRICT)


@by_form(SEEDS, mean)
def above_truth(results: Results, form: Form) -> Any:
    """Larger excess of x and of its velocity, in standard errors of the mean that table III.1 prints."""
    printed = published()["truth"]
    excess = []
    for quantity in ("position_nmse", "velocity_nmse"):
        scores = results.wide(quantity, "model", **SIMULATED, **REACHING, form=[form, ""])
        scores = scores.reindex(columns=[GROUND_TRUTH, *STRICT])
        error = printed["std"][quantity] / np.sqrt(printed["seeds"])
        excess.append(scores.sub(scores[GROUND_TRUTH], axis=0) / error)
    return named(np.maximum(*excess), STRICT)


@by_form(SEEDS, geometric_mean)
def over_strict(results: Results, form: Form) -> Any:
    """NMSE of the tool's velocity in unseen reaches over that of SPD, Tri and Cov."""
    return over(results.wide("velocity_nmse", "model", **SIMULATED, **REACHING, form=form), NETWORKS, STRICT)


@by_form(SEEDS, geometric_mean)
def over_less(results: Results, form: Form) -> Any:
    """Likewise of less constrained structures."""
    scores = results.wide("velocity_nmse", "model", **SIMULATED, **REACHING, form=form)
    return over(scores, LESS_STRICT, STRICT)


@SEEDS.finding(geometric_mean)
def oscillation(results: Results) -> Any:
    """RMS error of the tool's acceleration in reaches over that of other models."""
    scores = results.wide("acceleration_error", "model", **SIMULATED, **REACHING, form=CHOSEN)
    ratios = {f"{name} over SPD, Tri and Cov": one for name, one in over(scores, NETWORKS, STRICT).items()}
    return ratios | {"MLP over DeLaN": over(scores, ["mlp"], ["delan"])["MLP"]}


@SEEDS.finding(geometric_mean)
def part_nmse(results: Results) -> Any:
    """NMSE on the whole motion after learning from its first part."""
    return named(results.wide("nmse", "model", arm=PART, form=CHOSEN), STRICT)


@SEEDS.finding(geometric_mean)
def part_more(results: Results) -> Any:
    """Likewise of networks, over that of SPD, Tri and Cov."""
    return over(results.wide("nmse", "model", arm=PART, form=CHOSEN), NETWORKS, STRICT)


@by_loss(geometric_mean)
def online_course(results: Results, loss: Loss) -> Any:
    """NMSE, geometric mean over the batches, over that of SPD, Tri and Cov (figure III.2)."""
    return over(results.wide("online_course", "model", loss=loss), RIVALS, STRICT)


@by_loss(geometric_mean)
def online_half(results: Results, loss: Loss) -> Any:
    """NMSE on the whole motion after half of it, over that of SPD, Tri and Cov.

    An NMSE above 1, worse than a constant, counts as 1, so that nobody wins by being less bad.
    """
    return over(results.wide("online_half", "model", loss=loss).clip(upper=1.0), RIVALS, STRICT)


@by_loss(geometric_mean)
def online_final(results: Results, loss: Loss) -> Any:
    """NMSE on the whole motion after one pass."""
    return named(results.wide("online_final", "model", loss=loss), ("mlp_scaled", *RIVALS, *STRICT))


@SEEDS.finding(geometric_mean)
def online_scaled(results: Results) -> Any:
    """NMSE of the scaled perceptron online over that of SPD, Tri and Cov."""
    scores = {
        "over the course": results.wide("online_course", "model", loss="normalised"),
        "after half of it": results.wide("online_half", "model", loss="normalised").clip(upper=1.0),
    }
    return {when: over(its, ["mlp_scaled"], STRICT)["MLP, scaled"] for when, its in scores.items()}


@SEEDS.finding(minimum)
def consistent_links(results: Results) -> Any:
    """Share of physically consistent links."""
    return {name: its for name, its in _consistent(results).items() if name != "SPD"}


@SEEDS.finding(mean)
def spd_consistent(results: Results) -> Any:
    """Likewise of a structure that is positive definite only."""
    return _consistent(results)["SPD"]


def _consistent(results: Results) -> dict[str, pd.Series | None]:
    """Share of the links that are physically consistent, by seed."""
    met, every = (results.wide(name, "model", form=CHOSEN) for name in ("consistent_links", "links"))
    return named(met / every, STRICT)


# --- perturbed robots ---


def _robot_errors(results: Results, form: Form) -> pd.DataFrame:
    """NMSE on the robots' logs by robot, of known models and of those learned in a form."""
    return results.wide("nmse", "model", arm=ROBOT, form=[form, ""])


def _robot_reaches(results: Results, form: Form) -> pd.DataFrame:
    return results.wide("velocity_nmse", "model", arm=ROBOT, **REACHING, form=[form, ""])


@ROBOTS.finding(geometric_mean, headline=True)
def robot_known(results: Results) -> Any:
    """NMSE of models that were not learned on the robots' logs, mean over joints."""
    scores = _robot_errors(results, CHOSEN)
    return {model: scores.get(model) for model in (GROUND_TRUTH, DEFAULT)}


def _default_nmse(results: Results) -> Any:
    """NMSE of the URDF's model on a robot's log, mean over joints."""
    return results.each("nmse", arm=ROBOT, model=DEFAULT)


def _true_friction(results: Results, term: str) -> Any:
    """A robot's friction, median over joints."""
    return results.each(f"{term}_true")


for end, statistic in (("lowest", minimum), ("highest", maximum)):
    ROBOTS.finding(statistic, name=f"{end}_default")(_default_nmse)
    for term, unit in FRICTION_UNITS.items():
        ROBOTS.finding(statistic, unit, name=f"{end}_{term}")(partial(_true_friction, term=term))


@by_form(ROBOTS, geometric_mean, headline=("Cov",))
def robot_residual(results: Results, form: Form) -> Any:
    """NMSE on the robots' logs with viscous friction."""
    return named(_robot_errors(results, form), STRUCTURED)


@by_form(ROBOTS, geometric_mean)
def robot_gain(results: Results, form: Form) -> Any:
    """NMSE of the default model over that of structures with viscous friction."""
    ratios = over(_robot_errors(results, form), STRUCTURED, [DEFAULT])
    return {name: 1.0 / ratio for name, ratio in ratios.items()}


@by_form(ROBOTS, geometric_mean)
def robot_networks(results: Results, form: Form) -> Any:
    """NMSE of networks on the robots' logs."""
    return named(_robot_errors(results, form), NETWORKS)


@by_form(ROBOTS, geometric_mean, headline=("Cov",))
def robot_coulomb(results: Results, form: Form) -> Any:
    """NMSE on the robots' logs with viscous and Coulomb friction."""
    scores = _robot_errors(results, form)
    return {model_name(model): scores.get(f"{model}{COULOMB}") for model in STRICT}


@by_form(ROBOTS, geometric_mean)
def static_friction(results: Results, form: Form) -> Any:
    """NMSE without Coulomb friction over that with it."""
    scores = _robot_errors(results, form)
    return {
        model_name(model): over(scores, [model], [f"{model}{COULOMB}"])[model_name(model)] for model in STRICT
    }


@by_form(ROBOTS, lambda stopped: share(int(stopped.sum()), len(stopped)))  # one run per robot
def robot_delan_stopped(results: Results, form: Form) -> Any:
    """Share of the robots whose reaches with DeLaN were stopped."""
    return results.each("stopped", arm=ROBOT, **REACHING, model="delan", form=form)


@by_form(ROBOTS, geometric_mean)
def robot_mlp(results: Results, form: Form) -> Any:
    """NMSE of the tool's velocity in robots' reaches over that with the default model."""
    return over(_robot_reaches(results, form), ["mlp"], [DEFAULT])


@by_form(ROBOTS, geometric_mean)
def robot_reaches(results: Results, form: Form) -> Any:
    """Likewise of structures."""
    return over(_robot_reaches(results, form), STRUCTURED, [DEFAULT])


@by_form(ROBOTS, geometric_mean)
def robot_feedback(results: Results, form: Form) -> Any:
    """Share of the feedback in the torques along sines over that with the default model."""
    scores = results.wide("feedback_share", "model", arm=ROBOT, task=SINE, form=[form, ""])
    return over(scores, STRUCTURED, [DEFAULT])


@ROBOTS.finding(mean)
def friction_error(results: Results) -> Any:
    """Relative error of friction coefficients, median over joints."""
    return {term: results.each(f"{term}_error", model=FRICTION_MODELS[-1]) for term in ("viscous", "coulomb")}


@ROBOTS.finding(geometric_mean)
def viscous_factor(results: Results) -> Any:
    """Viscous coefficients over the true ones where Coulomb friction was not learned."""
    return results.each("viscous_ratio", model=FRICTION_MODELS[0])


@ROBOTS.finding(mean)
def payload_mass_error_share(results: Results) -> Any:
    """Relative error of the payload's mass."""
    return results.each("payload_mass_error")


@ROBOTS.finding(geometric_mean)
def payload_nmse(results: Results) -> Any:
    """NMSE on the next batch with a payload, of the empty arm's model and of the one that learns."""
    scores = results.wide("payload_nmse", "model")
    return {model: scores.get(model) for model in ("fixed", "learned")}


@ROBOTS.finding(lambda settled: exact_count(int(settled.sum()), len(settled)))
def payload_settled(results: Results) -> Any:
    """Robots on which the payload's mass stays correct."""
    return results.each("payload_settled")


@ROBOTS.finding(lambda seconds: exact(np.median(seconds), len(seconds)), unit="s")
def payload_settling_median(results: Results) -> Any:
    """Time from the pick-up until it does."""
    return results.each("payload_settling")


ROBOTS.finding(minimum, unit="s", name="payload_settling_min")(payload_settling_median)
ROBOTS.finding(maximum, unit="s", name="payload_settling_max")(payload_settling_median)


@lru_cache
def published() -> Mapping[str, Any]:
    """Values printed in the dissertation, from `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def findings(population: Population, agreement_n_m: Sequence[float]) -> Findings:
    """All findings of the page.

    `agreement_n_m`: largest difference of our torques from Pinocchio's, by URDF.
    """
    find = Findings("seeds")
    SEEDS.evaluate(find, population)
    ROBOTS.evaluate(find.among("simulated robots"), population)
    worst = float(np.max(agreement_n_m))
    find.among("URDFs").exact("rnea_max_error_nm", worst, len(agreement_n_m), unit="N m", headline=True)
    return find
