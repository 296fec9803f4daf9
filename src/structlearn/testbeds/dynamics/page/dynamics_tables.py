"""Tables of the dynamics testbed: published beside reproduced, and what was learned beside the truth."""

import numpy as np
import pandas as pd

from structlearn.reporting.prose import with_spread
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, in_order, model_name
from structlearn.rigid_body.seeded_training import PLAIN, SCHEDULED
from structlearn.testbeds.dynamics.page.dynamics_published import ROBOT as PRINTED_ROBOT
from structlearn.testbeds.dynamics.page.dynamics_published import ROBOT_NMSE, SIMULATION
from structlearn.testbeds.dynamics.page.dynamics_results import IDEAL, REACH, ROBOT, SINE, DynamicsResults

PRINTED, HERE = "dissertation", "here"

SCORES = {
    "sine_position": (SINE, "position_nmse"),
    "sine_velocity": (SINE, "velocity_nmse"),
    "reach_position": (REACH, "position_nmse"),
    "reach_velocity": (REACH, "velocity_nmse"),
}
"""Columns of tables III.1 and III.2: task and column of the scores."""

BODIES = {"positive_mass": "positive mass", "positive_definite": "positive definite", "triangle": "triangle"}
"""Conditions on a body, columns of `inertia_tables.link_table`."""


def tables(results: DynamicsResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    found = {
        "simulation": simulation(results),
        "epochs": epochs(results),
        "scores": results.scores,
        "outcomes": results.outcomes,
        "online": online(results),
        "bodies": bodies(results),
        "links": links(results),
        "base_parameters": base_parameters(results),
        "base_errors": base_errors(results),
        "robot_errors": robot_errors(results),
        "friction": friction(results),
        "payload": results.payload,
        "agreement": results.agreement,
    }
    return found | ({"robot": robot(results)} if results.tracked(ROBOT) else {})


def simulation(results: DynamicsResults) -> pd.DataFrame:
    """Table III.1: `model`, `source`, `epochs`, the columns of `SCORES` as texts, `stopped` runs."""
    rows = []
    for model in results.tracked(IDEAL):
        if model in SIMULATION:
            rows.append({"model": model_name(model), "source": PRINTED} | SIMULATION[model]._asdict())
        rows.append(_scored(results, IDEAL, model))
    return pd.DataFrame(rows)


def robot(results: DynamicsResults) -> pd.DataFrame:
    """Table III.2: `model`, `source`, `epochs`, `nmse` on the log, columns of `SCORES`, `stopped` runs."""
    rows = []
    for model in results.tracked(ROBOT):
        if model in PRINTED_ROBOT:
            printed = PRINTED_ROBOT[model]._asdict() | {"nmse": ROBOT_NMSE[model]}
            rows.append({"model": model_name(model), "source": PRINTED} | printed)
        rows.append(_scored(results, ROBOT, model) | {"nmse": f"{results.robot_error(model):.3f}"})
    return pd.DataFrame(rows)[["model", "source", "epochs", "nmse", *SCORES, "stopped"]]


def epochs(results: DynamicsResults) -> pd.DataFrame:
    """Epochs to the threshold in simulation, with both losses and both optimisers.

    Returns:
        Per `model`: texts `raw`, `raw_but_last` (without the last joint), `normalised`, `plain` (raw loss,
        plain optimiser).
    """
    rows = []
    for model in results.kinds:
        row = {"model": model_name(model)}
        for column, loss, optimiser in (
            ("raw", "raw", SCHEDULED),
            ("normalised", "normalised", SCHEDULED),
            ("plain", "raw", PLAIN),
        ):
            outcome = results.outcome(IDEAL, model, loss, optimiser)
            row[column] = epochs_text(outcome) if len(outcome) else ""
        outcome = results.outcome(IDEAL, model, "raw")
        known = outcome["epochs_but_last"].dropna()
        row["raw_but_last"] = _counted(with_spread(known.mean(), known.std()), len(known), len(outcome))
        rows.append(row)
    return pd.DataFrame(rows)[["model", "raw", "raw_but_last", "normalised", "plain"]]


def epochs_text(outcome: pd.DataFrame) -> str:
    """`2.0 ± 0.7`; `3.0 (1 of 5)` where others did not get there, `> 40` where none did."""
    reached = outcome[outcome["reached"]]["epochs"]
    if not len(reached):
        return f"> {outcome['epochs'].max():.0f}"
    return _counted(with_spread(reached.mean(), reached.std()), len(reached), len(outcome))


def _counted(text: str, some: int, every: int) -> str:
    """How many of how many a number is of, unless it is all of them."""
    if some == 0:
        return "not reached"
    return text if some == every else f"{text} ({some} of {every})"


def _scored(results: DynamicsResults, robot_name: str, model: str) -> dict[str, str]:
    outcome = results.outcome(robot_name, model)
    row = {"model": model_name(model), "source": HERE, "epochs": epochs_text(outcome) if len(outcome) else ""}
    for column, (task, score) in SCORES.items():
        runs = results.runs(robot_name, model, task)
        row[column] = "unstable" if (runs["stopped"] != "").all() else _spread(runs[score], ".3f")
    count = sum(len(results.runs(robot_name, model, task)) for task in (SINE, REACH))
    return row | {"stopped": f"{results.stopped(robot_name, model)} of {count}"}


def online(results: DynamicsResults) -> pd.DataFrame:
    """Of learning online, mean over seeds: `model`; `final_raw`, `final_normalised` NMSE after one pass."""
    rows = []
    for model in in_order(results.online["model"].unique()):
        row = {"model": model_name(model)}
        for loss in results.online["loss"].unique():
            scores = results.online_scores(loss).loc[model]
            row[f"final_{loss}"] = scores["final"].mean()
            row[f"course_{loss}"] = 10.0 ** scores["speed"].mean()
        rows.append(row)
    return pd.DataFrame(rows)


def bodies(results: DynamicsResults) -> pd.DataFrame:
    """Per `model`: number of learned `links`, and how many of them meet each condition of `BODIES`."""
    rows = []
    for model in results.structures:
        its = _of_loss(results, results.links, model)
        met = {name: int(its[name].sum()) for name in BODIES}
        every = its[list(BODIES)].all(axis=1).sum()
        rows.append({"model": model_name(model), "links": len(its)} | met | {"possible": int(every)})
    return pd.DataFrame(rows)


def links(results: DynamicsResults, model: str = "cov") -> pd.DataFrame:
    """Learned masses, centres and largest moments of a model beside the truth, mean ± std over seeds.

    Returns:
        Per `link`: `mass_kg`, `centre_m` (distance of the learned centre from the true one) and
        `moment_kg_m2` (largest), each learned as text, with `true_mass_kg` and `true_moment_kg_m2`.
    """
    its = _of_loss(results, results.links, model)
    axes = [f"centre_{axis}_m" for axis in "xyz"]
    away = its[axes].to_numpy() - its[[f"true_{axis}" for axis in axes]].to_numpy()
    its = its.assign(away=np.linalg.norm(away, axis=1))
    rows = []
    for link, group in its.groupby("link", sort=False):
        rows.append(
            {
                "link": link,
                "true_mass_kg": group["true_mass_kg"].iloc[0],
                "mass_kg": _spread(group["mass_kg"], ".2f"),
                "centre_m": _spread(group["away"], ".3f"),
                "true_moment_kg_m2": group["true_moment_3_kg_m2"].iloc[0],
                "moment_kg_m2": _spread(group["moment_3_kg_m2"], ".4f"),
            }
        )
    return pd.DataFrame(rows)


def base_parameters(results: DynamicsResults, model: str = "cov") -> pd.DataFrame:
    """Base parameters of a model: `parameter`, `truth`, `learned` (mean over seeds) and its `std`."""
    its = _of_loss(results, results.base, model)
    by = its.groupby("parameter", sort=False)
    learned = pd.DataFrame(
        {"truth": by["truth"].first(), "learned": by["value"].mean(), "std": by["value"].std()}
    )
    return learned.reset_index()


def base_errors(results: DynamicsResults) -> pd.DataFrame:
    """How far learned parameters are from the truth: what torques show, and what they do not.

    Returns:
        Per `model` the median over parameters and seeds of the relative error: of base parameters, `base`,
        and of masses, `mass`.
    """
    rows = []
    for model in results.structures:
        row: dict[str, object] = {"model": model_name(model)}
        for column, table, names in (
            ("base", results.base, ("value", "truth")),
            ("mass", results.links, ("mass_kg", "true_mass_kg")),
        ):
            learned, true = (_of_loss(results, table, model)[name] for name in names)
            shown = true != 0.0
            row[column] = float(((learned - true)[shown] / true[shown]).abs().median())
        rows.append(row)
    return pd.DataFrame(rows)


def robot_errors(results: DynamicsResults) -> pd.DataFrame:
    """NMSE on the robot's log, mean over seeds: `model`, `joint_1` ..., `mean`."""
    rows = []
    for model in in_order([*results.known["model"], *results.robot_models]):
        known = results.known[results.known["model"] == model].set_index("joint")["nmse"]
        errors = known if len(known) else results.kept_errors(ROBOT, model).mean()
        row = {"model": model_name(model)} | {f"joint_{joint}": error for joint, error in errors.items()}
        rows.append(row | {"mean": errors.mean()})
    return pd.DataFrame(rows)


def friction(results: DynamicsResults, model: str = f"cov{COULOMB}") -> pd.DataFrame:
    """Learned friction beside the truth: `joint`; `true_` and learned `viscous` and `coulomb`, as text."""
    its = results.friction[results.friction["model"] == model]
    rows = []
    for joint, group in its.groupby("joint"):
        row: dict[str, object] = {"joint": joint}
        for term, values in group.groupby("term", sort=False):
            row |= {f"true_{term}": values["truth"].iloc[0], term: _spread(values["value"], ".3f")}
        rows.append(row)
    return pd.DataFrame(rows)


def best_of_robot(results: DynamicsResults) -> frozenset[int]:
    """Rows of `robot_errors` that are known and not learned."""
    names = {model_name(model) for model in (GROUND_TRUTH, DEFAULT)}
    return frozenset(place for place, name in enumerate(robot_errors(results)["model"]) if name in names)


def _of_loss(results: DynamicsResults, table: pd.DataFrame, model: str) -> pd.DataFrame:
    return table[(table["model"] == model) & (table["loss"] == results.loss)]


def _spread(values: pd.Series, number_format: str) -> str:
    """Mean ± std, as in the dissertation without a std that would be written as zero."""
    std = values.std()
    if float(format(std, number_format)) == 0.0:
        std = np.nan
    return with_spread(values.mean(), std, number_format)
