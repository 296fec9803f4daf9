"""The dissertation's statements on learned dynamics, beside what is found here."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE, mean_interval, verdict
from structlearn.reporting.claim_rows import HOLDS, Row
from structlearn.reporting.prose import interval, listing, with_interval
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, NAMES, model_name
from structlearn.testbeds.dynamics.page.dynamics_published import (
    DEFAULT_OVER_STRUCTURED,
    NETWORK_NMSE,
    SIMULATION,
)
from structlearn.testbeds.dynamics.page.dynamics_results import IDEAL, REACH, ROBOT, SINE, DynamicsResults

AIMED_EPOCHS = 3
"""Epochs within which the strict structures are to reach the threshold with the raw loss."""

AIMED_FACTOR = 3.0
"""By which structured models with friction are to beat the default model on the stand-in's log."""

AIMED_TORQUE_N_M = 1e-9
"""Largest difference from Pinocchio."""

SAME_NMSE = 0.001
"""The last digit of tables III.1 and III.2."""

AS_GOOD = 1.1
"""Ratio of two errors up to which one counts as as good as the other."""

Gain = tuple[float, float]
"""Mean over seeds, and half the width of its 95 % interval."""


def dynamics_claims(results: DynamicsResults) -> list[Row]:
    """Rows of the table of claims; a claim on models that were not run is left out."""
    rows: list[Row | None] = [
        _agrees(results),
        _within_epochs(results),
        _faster(results),
        _as_the_truth(results),
        _better_than_rivals(results),
        *_oscillates(results, IDEAL, "Table III.1"),
        _fastest_online(results),
        _best_online(results),
        _better_than_default(results),
        _networks_fit(results),
    ]
    if results.tracked(ROBOT):
        rows += [_delan_unstable(results), *_oscillates(results, ROBOT, "Table III.2"), _as_default(results)]
    return [row for row in (*rows, _static_friction(results)) if row is not None]


def claims_frame(rows: Sequence[Row]) -> pd.DataFrame:
    """The table of claims."""
    return pd.DataFrame(rows, columns=["statement", "source", "found", "holds"])


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"


def _agrees(results: DynamicsResults) -> Row:
    largest = results.largest_disagreement
    robots = len(results.agreement)
    return (
        f"Torques are Pinocchio's to {AIMED_TORQUE_N_M:.0e} N m".replace("-", "\N{MINUS SIGN}"),
        "this project",
        f"largest difference on {robots} URDFs: {largest:.1e} N m".replace("-", "\N{MINUS SIGN}"),
        _yes(largest <= AIMED_TORQUE_N_M),
    )


def _within_epochs(results: DynamicsResults) -> Row | None:
    found = {model: results.outcome(IDEAL, model, "raw") for model in results.strict}
    if not found:
        return None
    limit = results.training.epochs.raw
    each = [
        f"{NAMES[model]} at most {its['epochs'].max():.0f}"
        if its["reached"].all()
        else f"{NAMES[model]} {int(its['reached'].sum())} of {len(its)} within {limit}"
        for model, its in found.items()
    ]
    holds = all(its["reached"].all() and its["epochs"].max() <= AIMED_EPOCHS for its in found.values())
    return (
        f"{_names(found)} are good enough on every joint after at most {AIMED_EPOCHS} epochs (raw loss)",
        "Table III.1 and this project",
        ", ".join(each),
        _yes(holds),
    )


def _faster(results: DynamicsResults) -> Row | None:
    def epochs(model: str) -> np.ndarray:
        return results.outcome(IDEAL, model, "raw")["epochs"].to_numpy()

    gains = _gains(epochs, results.strict, results.rivals)
    if not gains:
        return None
    return (
        f"{_names(results.strict)} train faster than every less constrained model",
        "III.4.1.1, Table III.1",
        f"epochs more, 95 % interval over seeds, raw loss: {_listed(gains, '.1f')}; where the threshold was "
        f"not reached, {results.training.epochs.raw} epochs are counted",
        _all_hold(gains),
    )


def _as_the_truth(results: DynamicsResults) -> Row | None:
    columns = ("position_nmse", "velocity_nmse")
    gaps = {
        model: [_difference(results, model, GROUND_TRUTH, column) for column in columns]
        for model in results.strict
        if model in results.tracked(IDEAL)
    }
    if not gaps:
        return None
    every = [gap for both in gaps.values() for gap in both]
    holds = "yes" if all(mean + half <= SAME_NMSE for mean, half in every) else UNDECIDED
    if any(mean - half > SAME_NMSE for mean, half in every):
        holds = "no"
    each = [f"{NAMES[model]} {with_interval(*both[1], '.4f')}" for model, both in gaps.items()]
    return (
        f"{_names(gaps)} track unseen reaches as well as the ground truth",
        "Table III.1",
        f"velocity NMSE above that of the ground truth ({results.velocity(GROUND_TRUTH).mean():.4f}): "
        f"{', '.join(each)}; yes means: in velocity and position at most {SAME_NMSE:g}, the last printed "
        "digit",
        holds,
    )


def _better_than_rivals(results: DynamicsResults) -> Row | None:
    def logarithm(model: str) -> np.ndarray:
        return np.log10(results.velocity(model).to_numpy())

    strict, rivals = (
        [model for model in models if model in results.tracked(IDEAL)]
        for models in (results.strict, results.rivals)
    )
    gains = _gains(logarithm, strict, rivals)
    if not gains:
        return None
    return (
        f"{_names(strict)} generalise better to unseen reaches than every other model",
        "Table III.1",
        f"velocity error of the others over theirs, 95 % interval over seeds: {_factors(gains)}",
        _all_hold(gains),
    )


def _oscillates(results: DynamicsResults, robot: str, source: str) -> list[Row]:
    """MLP and, in simulation, DeLaN beside the best that is known of the robot."""
    reference = GROUND_TRUTH if robot == IDEAL else DEFAULT
    words = {"mlp": "MLP oscillates", "delan": "DeLaN oscillates mildly"}
    rows: list[Row] = []
    for model, word in words.items():
        if model not in results.tracked(robot) or (model == "delan" and robot == ROBOT):
            continue
        ratio = _ratio(results, robot, model, reference, REACH, "velocity_nmse")
        score = results.velocity(model, robot).mean()
        stopped = int((results.runs(robot, model, REACH)["stopped"] != "").sum())
        rows.append(
            (
                f"{word} in reaches{'' if robot == IDEAL else ' of the robot'}",
                source,
                f"NMSE of the tool's velocity {score:.3f}, {_factor(ratio)} times that of the "
                f"{NAMES[reference]}; {stopped} of {len(results.runs(robot, model, REACH))} runs stopped",
                "no, it is unstable"
                if model == "delan" and stopped
                else HOLDS[str(verdict(ratio[0] - ratio[1], ratio[0] + ratio[1]))],
            )
        )
    return rows


def _fastest_online(results: DynamicsResults) -> Row | None:
    scores = results.online_scores()["speed"]
    strict, gains = _online_gains(results, scores)
    if not gains:
        return None
    return (
        f"Online, {_names(strict)} learn fastest",
        "Fig. III.2",
        "NMSE on the whole motion, geometric mean over the batches, of the others over theirs: "
        f"{_factors(gains)}",
        _all_hold(gains),
    )


def _best_online(results: DynamicsResults) -> Row | None:
    _, gains = _online_gains(results, np.log10(results.online_scores()["final"]))
    if not gains:
        return None
    return (
        "… and generalise best to what they have not seen yet",
        "Fig. III.2",
        f"NMSE on the whole motion after one pass, of the others over theirs: {_factors(gains)}",
        _all_hold(gains),
    )


def _better_than_default(results: DynamicsResults) -> Row | None:
    default = results.robot_error(DEFAULT)
    structured = [model for model in results.robot_models if model in (*results.strict, "symm")]
    factors = {model: default / results.robot_error(model) for model in structured}
    if not factors:
        return None
    return (
        f"On the robot's log, structured models with viscous friction beat the default one by a factor of "
        f"{AIMED_FACTOR:g}",
        "Table III.2 and this project",
        f"NMSE of the default model {default:.3f}; factors: "
        + ", ".join(f"{NAMES[model]} {factor:.1f}" for model, factor in factors.items())
        + f" (published {DEFAULT_OVER_STRUCTURED:.1f})",
        _yes(min(factors.values()) >= AIMED_FACTOR),
    )


def _networks_fit(results: DynamicsResults) -> Row | None:
    found = {model: results.robot_error(model) for model in ("mlp", "delan") if model in results.robot_models}
    if not found:
        return None
    return (
        f"{_names(found)}: an NMSE below {NETWORK_NMSE:g} on the robot's log",
        "III.4.2.1",
        f"{_errors(found)}, at most {results.training.epochs.robot} epochs",
        _yes(max(found.values()) < NETWORK_NMSE),
    )


def _delan_unstable(results: DynamicsResults) -> Row | None:
    runs = results.runs(ROBOT, "delan", REACH)
    if runs.empty:
        return None
    stopped = int((runs["stopped"] != "").sum())
    return (
        "DeLaN is unstable in reaches of the robot",
        "Table III.2",
        f"{stopped} of {len(runs)} runs had to be stopped",
        _yes(stopped == len(runs)) if stopped in (0, len(runs)) else "in part",
    )


def _as_default(results: DynamicsResults) -> Row | None:
    models = [model for model in ("symm", *results.strict) if model in results.tracked(ROBOT)]
    if not models:
        return None
    ratios = {model: _ratio(results, ROBOT, model, DEFAULT, REACH, "velocity_nmse") for model in models}
    sines = {model: _ratio(results, ROBOT, model, DEFAULT, SINE, "velocity_nmse")[0] for model in models}
    worse = any(mean - half > np.log10(AS_GOOD) for mean, half in ratios.values())
    better = all(mean + half < np.log10(AS_GOOD) for mean, half in ratios.values())
    return (
        "Structured models track reaches of the robot about as well as the default one",
        "Table III.2",
        f"velocity error over that of the default model: {_factors(ratios)}; on sines "
        f"{', '.join(f'{NAMES[model]} {10.0**mean:.2f}' for model, mean in sines.items())}",
        "no" if worse else "yes" if better else UNDECIDED,
    )


def _static_friction(results: DynamicsResults) -> Row | None:
    pairs = {
        model: f"{model}{COULOMB}" for model in results.strict if f"{model}{COULOMB}" in results.robot_models
    }
    if not pairs:
        return None
    gains, found = {}, []
    for model, rubbing in pairs.items():
        without, with_it = (results.outcome(ROBOT, name)["nmse_mean"].to_numpy() for name in (model, rubbing))
        gains[model] = mean_interval(without - with_it)
        found.append(f"{model_name(model)} {without.mean():.4f} → {with_it.mean():.4f}")
    return (
        "Static friction is what the structured models lack; learning it (Coulomb) lowers their error",
        "III.4.2.1, future work",
        f"NMSE on the robot's log without → with: {', '.join(found)}",
        _all_hold(gains),
    )


def _online_gains(results: DynamicsResults, scores: pd.Series) -> tuple[list[str], dict[str, Gain]]:
    """Strict structures that learned online, and the gains over their rivals in scores by model and seed."""
    there = scores.index.unique("model")
    strict, rivals = (
        [model for model in models if model in there] for models in (results.strict, results.rivals)
    )
    return strict, _gains(lambda model: scores[model].to_numpy(), strict, rivals)


def _gains(
    score: Callable[[str], np.ndarray], strict: Sequence[str], rivals: Sequence[str]
) -> dict[str, Gain]:
    """Score of every rival minus the mean of the strict structures, seed by seed; empty if either is."""
    if not strict:
        return {}
    theirs = np.mean([score(model) for model in strict], axis=0)
    return {model: mean_interval(score(model) - theirs) for model in rivals}


def _ratio(results: DynamicsResults, robot: str, model: str, other: str, task: str, column: str) -> Gain:
    """Logarithm (base 10) of a model's error over another's, seed by seed."""
    both = [np.log10(results.runs(robot, name, task)[column]) for name in (model, other)]
    return mean_interval((both[0] - both[1]).dropna().to_numpy())  # known models may have other seeds


def _difference(results: DynamicsResults, model: str, other: str, column: str) -> Gain:
    """A model's error in reaches in simulation minus another's, seed by seed."""
    both = [results.runs(IDEAL, name, REACH)[column] for name in (model, other)]
    return mean_interval((both[0] - both[1]).dropna().to_numpy())  # known models may have other seeds


def _all_hold(gains: Mapping[str, Gain]) -> str:
    """Whether all gains over models of the dissertation are above zero; which are not, where some are."""
    words = {
        model: str(verdict(mean - half, mean + half))
        for model, (mean, half) in gains.items()
        if model in SIMULATION
    }
    wrong = [NAMES[model] for model, word in words.items() if word != BETTER]
    if not wrong:
        return "yes"
    if len(wrong) < len(words):
        return f"not for {listing(wrong)}"
    return "no" if WORSE in words.values() else UNDECIDED


def _names(models: Iterable[str]) -> str:
    return listing(NAMES[model] for model in models)


def _listed(gains: Mapping[str, Gain], number_format: str) -> str:
    return ", ".join(
        f"{NAMES[model]} {mean:{number_format}} {interval(mean - half, mean + half, number_format)}"
        for model, (mean, half) in gains.items()
    ).replace("-", "\N{MINUS SIGN}")


def _factors(gains: Mapping[str, Gain]) -> str:
    return ", ".join(f"{NAMES[model]} {_factor(gain)}" for model, gain in gains.items())


def _factor(gain: Gain) -> str:
    """`12 [3.4, 45]` of a logarithm."""
    low, mean, high = (10.0 ** (gain[0] + sign * gain[1]) for sign in (-1, 0, 1))
    if not np.isfinite(low):
        return _short(mean)
    return f"{_short(mean)} [{_short(low)}, {_short(high)}]"


def _short(value: float) -> str:
    """Two or three digits, without exponent from a thousandth to a million."""
    if not 1e-3 <= value < 1e6:
        return f"{value:.0e}".replace("-", "\N{MINUS SIGN}")
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}" if value >= 1 else f"{value:.2g}"


def _errors(errors: Mapping[str, float]) -> str:
    return ", ".join(f"{NAMES[model]} {_short(error)}" for model, error in errors.items())
