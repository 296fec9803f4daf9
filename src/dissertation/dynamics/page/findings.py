"""Findings on learned dynamics for the page's sentences and claims.

n counts seeds in simulation, and robots elsewhere; ratios and differences are paired. The published form
decides the dissertation's claims; our form has separate claims. Models that did not meet the training
criterion decide nothing (`UNMET`), since the dissertation trained until it was met. Seeds and robots of the
study `dynamics/robots` are pooled with those of this run.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.dynamics.names import IDEAL, REACH, ROBOT, SINE
from dissertation.dynamics.protocol.tracking import KNOWN
from dissertation.dynamics.protocol.trainings import LOSSES, OURS, PUBLISHED, Form
from dissertation.evidence.studies import Study, extended
from dissertation.simulation.arm import Mechanics
from structlearn.core.metrics import nmse
from structlearn.core.params import read_values
from structlearn.reporting.evidence import Evidence, Found, geometric_mean, mean, unknown
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.compiled_dynamics import friction_rows, inverse_dynamics
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.model_names import (
    COULOMB,
    DEFAULT,
    GROUND_TRUTH,
    STRICT,
    model_name,
    models_in_order,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.robot import Robot, torque_differences

STOPPED_NMSE = 1.0  # least error counted for a stopped run: that of an arm that does not move
SETTLED_SHARE = 0.1  # relative error of a payload's mass within which it counts as correct
TERMS: tuple[FrictionTerm, ...] = ("viscous", "coulomb")  # friction of the simulated robots
RESIDUAL_RATE_HZ = 10.0  # sampling rate of the residual torques kept for drawing
NETWORKS = ("mlp", "delan")  # published models without inertial parameters

RIVALS = {PUBLISHED: (*NETWORKS, "nostr", "symm"), OURS: ("mlp", "mlp_scaled", "delan", "nostr", "symm")}
"""Models less constrained than SPD, Tri and Cov, by form."""

UNMET = "no network of this kind met the criterion"

SUFFIXES = {OURS: "", PUBLISHED: "_plain"}
"""Case suffix of each form: the published one uses plain Adam and the plain loss."""

HEADLINES = (*(f"{model}_plain" for model in STRICT), "mlp", "delan", "cov")  # epochs in `metrics.json`
ROBOTS_STUDY = "dynamics/robots"  # further seeds and robots, pooled in the verdicts
STUDIED = ("outcomes", "scores", "payload", "known")  # tables that include the study's rows

IMPLEMENTATIONS = ("regressor_n_m", "compiled_n_m")
"""Columns of `agreement_with_pinocchio`: differences of the regressor and of the compiled recursion."""

Scores = Callable[[str], pd.Series]
"""Maps a model to its scores by seed or robot; empty if it was not run."""


@dataclass(frozen=True)
class DynamicsResults:
    """Outputs of the testbed's stages, with derived quantities; tables in `STUDIED` include the study's rows.

    A seed is the robot's, or in simulation that of a model's initial weights and of its goals.
    """

    errors: pd.DataFrame  # of trainings, see `protocol.trainings.train_all`
    outcomes: pd.DataFrame
    links: pd.DataFrame  # learned and true values, see `rigid_body.base_parameters`, with `model`, `form`
    base: pd.DataFrame
    scores: pd.DataFrame  # see `protocol.tracking.track`
    paths: pd.DataFrame
    online: pd.DataFrame  # see `rigid_body.payload`
    payload: pd.DataFrame  # likewise, with `seed`
    agreement: pd.DataFrame  # one row per URDF, see `agreement_with_pinocchio`, with `robot`
    known: pd.DataFrame  # errors on robots' logs, see `known_errors` and below, with `seed`
    friction: pd.DataFrame
    residuals: pd.DataFrame  # likewise, first robot only
    chosen: Mapping[str, Any]  # parameters, keyed as in `params.yaml`
    study: Study | None = None  # of further robots; None if it was not run with these parameters

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of models that were trained, in table order."""
        return models_in_order(self.outcomes["model"].str.removesuffix(COULOMB).unique())

    @cached_property
    def strict(self) -> list[str]:
        """Structures of `STRICT` that were trained."""
        return [kind for kind in self.kinds if kind in STRICT]

    @cached_property
    def robot_models(self) -> list[str]:
        """Models trained on robots' logs, in table order."""
        return models_in_order(self.outcomes.loc[self.outcomes["arm"] == ROBOT, "model"].unique())

    def tracked(self, arm: str) -> list[str]:
        """Models with tracking runs on an arm, in any form and in table order."""
        return models_in_order(self.scores.loc[self.scores["robot"] == arm, "model"].unique())

    def outcome(self, arm: str, model: str, form: Form = PUBLISHED) -> pd.DataFrame:
        """Training outcomes of a model (`cov`, `cov_coulomb`) by seed; empty if it was not trained.

        Where the threshold was not `reached`, `epochs` is the limit, a lower bound.
        """
        return self._outcomes(arm, model, form)

    def runs(self, arm: str, model: str, task: str, form: Form = PUBLISHED) -> pd.DataFrame:
        """Scores of a model that met the criterion, by seed; stopped runs score at least `STOPPED_NMSE`."""
        known = self._runs(arm, model, task, KNOWN)
        return known if len(known) else self._runs(arm, model, task, form)

    def velocity(self, arm: str, model: str, form: Form = PUBLISHED) -> pd.Series:
        """NMSE of the tool velocity in reaches, by seed; see `runs`."""
        return self.runs(arm, model, REACH, form)["velocity_nmse"]

    def stopped(self, arm: str, model: str, form: Form = PUBLISHED) -> tuple[int, int]:
        """Numbers of stopped runs and of all runs of a model, over sines and reaches."""
        halted = pd.concat([self.runs(arm, model, task, form)["stopped"] for task in (SINE, REACH)]) != ""
        return int(halted.sum()), len(halted)

    def robot_error(self, model: str, form: Form = PUBLISHED) -> pd.Series:
        """NMSE on robots' logs (mean over joints) of a known or learned model, by robot."""
        if model in (GROUND_TRUTH, DEFAULT):
            return self.known[self.known["model"] == model].groupby("seed")["nmse"].mean()
        return self.outcome(ROBOT, model, form)["nmse_mean"]

    @cached_property
    def online_curves(self) -> pd.DataFrame:
        """NMSE during online learning, mean over joints: `loss`, `model`, `seed`, `batch`, `nmse`."""
        keys = ["loss", "model", "seed", "batch"]
        return self.online.groupby(keys, sort=False)["nmse"].mean().reset_index()

    @cached_property
    def learned_online(self) -> pd.DataFrame:
        """By `loss`, `model` and `seed`: `final` NMSE, and `speed`, the mean log10 NMSE over batches."""
        curves = self.online_curves[self.online_curves["batch"] > 0].sort_values("batch")
        by = curves.assign(logarithm=np.log10(curves["nmse"])).groupby(["loss", "model", "seed"])
        own = pd.DataFrame({"final": by["nmse"].last(), "speed": by["logarithm"].mean()})
        return extended(own.reset_index(), self.study, "online_scores")

    def online_scores(self, form: Form = PUBLISHED) -> pd.DataFrame:
        """`learned_online` for the loss of a form, indexed by model and seed."""
        scores = self.learned_online[self.learned_online["loss"] == LOSSES[form]]
        return scores.set_index(["model", "seed"])[["final", "speed"]].sort_index()

    @cached_property
    def pick_up_s(self) -> float:
        """Time in s at which payloads are picked up."""
        motion = self.chosen["arm_motion"].used.cut(self.chosen["perturbed_robot"].log_s)
        return self.chosen["record_motion"].payload.at_share * motion.duration_s

    @cached_property
    def settling_s(self) -> pd.Series:
        """Time in s from pick-up until the learned mass stays correct, by robot; NaN if it never does."""
        mass_kg, found = self.chosen["record_motion"].payload.mass_kg, {}
        for seed, its in self.payload[self.payload["time_s"] > self.pick_up_s].groupby("seed"):
            wrong = (its["mass_kg"] - mass_kg).abs() > SETTLED_SHARE * mass_kg
            settled = its["time_s"][~wrong[::-1].cummax()[::-1]]
            found[seed] = settled.iloc[0] - self.pick_up_s if len(settled) else np.nan
        return pd.Series(found, dtype=float)

    @cached_property
    def mass_errors(self) -> pd.Series:
        """Relative error of the payload's learned mass over the second half of its time, by robot."""
        late = 0.5 * (self.pick_up_s + self.payload["time_s"].max())
        mass = self.payload[self.payload["time_s"] > late].groupby("seed")["mass_kg"].mean()
        return (mass / self.chosen["record_motion"].payload.mass_kg - 1.0).abs()

    @cached_property
    def _outcomes(self) -> Callable[..., pd.DataFrame]:
        """See `outcome`."""
        limits = self.chosen["train_dynamics"].epochs
        rows = self.outcomes.sort_values("seed").set_index("seed")
        most = np.where(rows["arm"] == IDEAL, limits.simulation, limits.robot)
        reached = rows["epochs"].notna()
        rows = rows.assign(epochs=rows["epochs"].where(reached, most), reached=reached)
        return _rows_by(rows, ["arm", "model", "form"])

    @cached_property
    def _runs(self) -> Callable[..., pd.DataFrame]:
        """See `runs`."""
        columns = ["position_nmse", "velocity_nmse"]
        scores = self.scores.sort_values("seed").set_index("seed")
        counted = scores[columns].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE)
        scores = scores.assign(**counted.where(scores["stopped"] != "", scores[columns]))
        return _rows_by(scores, ["robot", "model", "task", "form"])


def _rows_by(table: pd.DataFrame, keys: list[str]) -> Callable[..., pd.DataFrame]:
    """Lookup of a table's rows by key, empty if unknown; groups once because pages look up hundreds."""
    groups, none = dict(iter(table.groupby(keys))), table.iloc[:0]
    return lambda *key: groups.get(key, none)


def agreement_with_pinocchio(robot: Robot) -> dict[str, float]:
    """Largest torque differences from Pinocchio over joints and random states, and the largest torque."""
    theta = link_parameters(robot.inertias.tensors()).numpy()
    compiled = inverse_dynamics(robot.tree, robot.inertias)
    functions = {
        "largest_n_m": lambda q, qd, qdd: np.zeros_like(q),
        "regressor_n_m": lambda *states: torque_regressor(robot.tree, *states) @ theta,
        "compiled_n_m": lambda *states: np.array([compiled(*state) for state in zip(*states, strict=True)]),
    }
    return {name: float(torque_differences(robot, torques).max()) for name, torques in functions.items()}


def known_errors(robot: Robot, mechanics: Mechanics, motion: Motion) -> pd.DataFrame:
    """Errors of the models not learned, truth and URDF (default): `model`, `joint` (from 1), `nmse`."""
    coefficients = np.stack([mechanics.viscous, mechanics.coulomb], axis=-1)
    friction = np.einsum("tjk,jk->tj", friction_columns(motion.q, motion.qd, TERMS), coefficients)
    torques = {
        GROUND_TRUTH: rigid_body_torques(robot.tree, mechanics.inertias, motion) + friction,
        DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion),
    }
    errors = pd.DataFrame({name: nmse(found, motion.torque) for name, found in torques.items()})
    errors["joint"] = np.arange(1, motion.joints + 1)
    return errors.melt("joint", var_name="model", value_name="nmse")[["model", "joint", "nmse"]]


def friction_table(models: Mapping[str, DynamicsModels], mechanics: Mechanics) -> pd.DataFrame:
    """Learned and true friction coefficients of one robot, for the first model of each set.

    Returns `model`, `joint` (from 1), `term`, `value` in N m s/rad or N m, and `truth`.
    """
    rows = []
    for name, its in models.items():
        learned = friction_rows(its.friction_coefficients()[0], its.friction)
        for place, term in enumerate(TERMS):
            if term in its.friction:
                pairs = zip(learned[place], getattr(mechanics, term), strict=True)
                rows += [(name, joint, term, *pair) for joint, pair in enumerate(pairs, start=1)]
    return pd.DataFrame(rows, columns=["model", "joint", "term", "value", "truth"])


def residual_torques(robot: Robot, models: DynamicsModels, motion: Motion, rate_hz: float) -> pd.DataFrame:
    """Measured torques minus the first model's rigid-body torques: friction and noise, at `RESIDUAL_RATE_HZ`.

    Returns `joint` (from 1), `velocity_rad_s`, `residual_n_m`, `friction_n_m`.
    """
    kept = motion.part(slice(None, None, max(1, round(rate_hz / RESIDUAL_RATE_HZ))))
    links = rigid_body_torques(robot.tree, models.inertias(), kept)[0]
    friction = predicted_torques(models, robot.tree, kept)[0] - links
    columns = {"velocity_rad_s": kept.qd, "residual_n_m": kept.torque - links, "friction_n_m": friction}
    joint = np.tile(np.arange(1, kept.joints + 1), len(kept))
    return pd.DataFrame({"joint": joint} | {name: values.ravel() for name, values in columns.items()})


@lru_cache
def published() -> Mapping[str, Any]:
    """Values printed in the dissertation, from `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def findings(results: DynamicsResults) -> Findings:
    """All findings of the page.

    `epochs`: until the threshold holds for every joint in simulation, or `epochs_limit`; geometric means, as
    claims compare models by ratio. `ee_velocity_nmse`: of the tool velocity in reaches; a stopped run scores
    at least 1 and counts among the `unstable` runs (sines and reaches). `robot_...`: the same for robots;
    `robot_nmse` is the error on their logs, mean over joints. `online_nmse`: on the whole motion after one
    pass. `payload_settling_s_...`: over the `payload_settled` robots, whose learned mass stays correct.
    """
    find = Findings("seeds")
    robots = find.among("simulated robots")
    robots.exact("robots", results.outcomes.loc[results.outcomes["arm"] == ROBOT, "seed"].nunique())
    robots.exact("robots_of_this_run", results.friction["seed"].nunique())
    differences = results.agreement[list(IMPLEMENTATIONS)].to_numpy()
    find.among("URDFs").exact(
        "rnea_max_error_nm", differences.max(), len(differences), unit="N m", headline=True
    )
    find.exact("base_parameters", results.base["parameter"].nunique())
    find.exact("epochs_limit", results.chosen["train_dynamics"].epochs.simulation)
    _models(find, robots, results)
    for form in (PUBLISHED, OURS):
        _in_simulation(find, results, form)
        _of_robots(robots, results, form)
    _online(find, results)
    robots.mean("payload_mass_error_share", results.mass_errors)
    settled = results.settling_s.dropna()
    robots.exact_count("payload_settled", len(settled), len(results.settling_s))
    for name in ("median", "min", "max"):  # NaN if no robot settled
        robots.exact(f"payload_settling_s_{name}", settled.agg(name), len(settled), unit="s")
    return find


def unmet(results: DynamicsResults, arm: str, form: Form) -> list[str]:
    """Models that missed the criterion with some seed or on some robot."""
    every = {model: results.outcome(arm, model, form)["met"] for model in RIVALS[form]}
    return [model for model, met in every.items() if len(met) and not met.all()]


def _models(find: Findings, robots: Findings, results: DynamicsResults) -> None:
    """Add the scores of every model that was run, in both forms."""
    epochs: dict[str, pd.Series] = {}
    errors = {name: results.robot_error(name) for name in results.known["model"].unique()}
    for form, suffix in SUFFIXES.items():
        epochs |= {f"{kind}{suffix}": results.outcome(IDEAL, kind, form)["epochs"] for kind in results.kinds}
        errors |= {f"{model}{suffix}": results.robot_error(model, form) for model in results.robot_models}
    find.geometric_mean("epochs", _run(epochs), headline=HEADLINES)
    robots.mean("robot_nmse", _run(errors), headline=(DEFAULT, "cov_plain", f"cov{COULOMB}_plain"))
    for robot, its, prefix in ((IDEAL, find, ""), (ROBOT, robots, "robot_")):
        tried = {
            f"{model}{'' if model in (GROUND_TRUTH, DEFAULT) else suffix}": (robot, model, form)
            for form, suffix in SUFFIXES.items()
            for model in results.tracked(robot)
        }
        velocity = _run({case: results.velocity(*key) for case, key in tried.items()})
        marked = (GROUND_TRUTH, "cov_plain") if robot == IDEAL else ()
        its.mean(f"{prefix}ee_velocity_nmse", velocity, headline=marked)
        its.exact_count(f"{prefix}unstable", {case: results.stopped(*tried[case]) for case in velocity})


def _in_simulation(find: Findings, results: DynamicsResults, form: Form) -> None:
    def epochs(model: str) -> pd.Series:
        return results.outcome(IDEAL, model, form)["epochs"]

    def reaches(model: str) -> pd.DataFrame:
        return results.runs(IDEAL, model, REACH, form)[["position_nmse", "velocity_nmse"]]

    strict, truth = results.strict, reaches(GROUND_TRUTH)
    above = {model_name(model): (reaches(model) - truth).dropna() for model in strict}
    velocity = partial(results.velocity, IDEAL, form=form)
    _cases(find.geometric_mean, f"epochs_{form}", {model: epochs(model) for model in strict})
    _ratios(find, f"epochs_more_{form}", epochs, RIVALS[form], strict)
    find.by(_largest, f"above_truth_{form}", above, missing=UNMET)
    _ratios(find, f"over_strict_{form}", velocity, NETWORKS if form == PUBLISHED else RIVALS[form], strict)


def _of_robots(find: Findings, results: DynamicsResults, form: Form) -> None:
    error, velocity = partial(results.robot_error, form=form), partial(results.velocity, ROBOT, form=form)
    strict = results.strict
    structured = [model for model in ("symm", *strict) if model in results.kinds]
    gains = {model: error(DEFAULT) / error(model) for model in structured}
    lacking = {model: error(model) - error(f"{model}{COULOMB}") for model in strict}
    stopped = results.runs(ROBOT, "delan", REACH, form)["stopped"] != ""
    _cases(find.geometric_mean, f"robot_gain_{form}", gains)
    _cases(find.mean, f"robot_networks_{form}", {model: error(model) for model in NETWORKS})
    if len(stopped):  # one run per robot: independent trials
        find.share(f"robot_delan_stopped_{form}", int(stopped.sum()), len(stopped))
    else:
        find.unknown(f"robot_delan_stopped_{form}", UNMET)
    _ratios(find, f"robot_mlp_{form}", velocity, ["mlp"], [DEFAULT])
    _ratios(find, f"robot_reaches_{form}", velocity, structured, [DEFAULT])
    _cases(find.mean, f"static_friction_{form}", lacking)


def _online(find: Findings, results: DynamicsResults) -> None:
    """Add the online-learning NMSE, and ratios of other models to SPD, Tri and Cov."""
    scores, strict, nothing = results.online_scores(), results.strict, pd.Series(dtype=float)

    def course(model: str) -> pd.Series:
        return 10.0 ** scores["speed"].get(model, nothing)

    def final(model: str) -> pd.Series:
        return scores["final"].get(model, nothing)

    find.mean("online_nmse", {model: final(model) for model in models_in_order(scores.index.unique("model"))})
    _ratios(find, "online_course", course, RIVALS[PUBLISHED], strict)
    _ratios(find, "online_final", final, RIVALS[PUBLISHED], strict)
    scaled = {"over the course": course, "after one pass": final}
    ratios = {when: _over(score, "mlp_scaled", strict).dropna() for when, score in scaled.items()}
    either = {when: geometric_mean(its) if len(its) else unknown(UNMET) for when, its in ratios.items()}
    find.add("online_scaled", either)


def _run(samples: Mapping[str, pd.Series]) -> Mapping[str, pd.Series]:
    """Leave out models that were not run."""
    return {model: its for model, its in samples.items() if len(its)}


def _cases(found: Callable[..., Found], name: str, samples: Mapping[str, pd.Series]) -> None:
    """Add one case per model; `UNMET` if it has no samples."""
    found(name, {model_name(model): its.dropna() for model, its in samples.items()}, missing=UNMET)


def _over(score: Scores, model: str, references: Sequence[str]) -> pd.Series:
    """Scores of a model over the geometric mean of the references, by seed; NaN where one is missing."""
    reference = 1.0
    for one in references:
        reference = reference * score(one) ** (1.0 / len(references))
    return score(model) / reference


def _ratios(
    find: Findings, name: str, score: Scores, models: Iterable[str], references: Sequence[str]
) -> None:
    """Add the score ratios of models to the geometric mean of the references, over common seeds."""
    _cases(find.geometric_mean, name, {model: _over(score, model, references) for model in models})


def _largest(samples: pd.DataFrame, comparisons: int) -> Evidence:
    """Mean of the column with the largest upper bound."""
    return max((mean(samples[column], comparisons) for column in samples), key=lambda one: one.high)
