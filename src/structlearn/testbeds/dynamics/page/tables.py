"""Tables of the dynamics testbed: published beside reproduced, and what was learned beside the truth."""

import numpy as np
import pandas as pd

from structlearn.reporting.document import Table
from structlearn.reporting.prose import with_spread
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, in_order, model_name
from structlearn.rigid_body.seeded_training import PLAIN, SCHEDULED
from structlearn.testbeds.dynamics.names import IDEAL, REACH, ROBOT, SINE
from structlearn.testbeds.dynamics.page.results import published
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

PRINTED, HERE = "dissertation", "here"

SCORES = {
    "sine_position": (SINE, "position_nmse"),
    "sine_velocity": (SINE, "velocity_nmse"),
    "reach_position": (REACH, "position_nmse"),
    "reach_velocity": (REACH, "velocity_nmse"),
}
"""Columns of tables III.1 and III.2: task and column of the scores."""

SCORE_HEADINGS = {
    "source": "",
    "nmse": "NMSE on the log",
    "sine_position": "sines, q",
    "sine_velocity": "q̇",
    "reach_position": "reaches, x",
    "reach_velocity": "ẋ",
}

CONDITIONS = ["positive_mass", "positive_definite", "triangle"]
"""On a body that can exist, columns of `inertia_tables.link_table`."""

DIFFERENCES = ("recursion_n_m", "regressor_n_m", "compiled_n_m")
"""From Pinocchio, of three ways to the same torques."""

DETAILED = "cov"
"""Structure whose learned bodies are listed."""

TRAININGS = {
    "raw": ("raw", SCHEDULED),
    "normalised": ("normalised", SCHEDULED),
    "plain": ("raw", PLAIN),
}
"""Columns of the table of epochs: loss and optimiser."""


def tables(results: DynamicsResults) -> dict[str, Table]:
    """Tables of the page by name; raw ones hold every run."""
    found = {name: Table(getattr(results, name)) for name in ("scores", "outcomes", "payload")}
    found |= {
        "simulation": _scores(results, IDEAL),
        "epochs": _epochs(results),
        "online": _online(results),
        "bodies": _bodies(results),
        "links": _links(results),
        "base_parameters": _base_parameters(results),
        "base_errors": _base_errors(results),
        "robot_errors": _robot_errors(results),
        "friction": _friction(results),
        "agreement": Table(results.agreement, dict.fromkeys(DIFFERENCES, ".1e") | {"largest_n_m": ".0f"}),
    }
    return found | ({"robot": _scores(results, ROBOT)} if results.tracked(ROBOT) else {})


def epochs_text(outcome: pd.DataFrame) -> str:
    """`2.0 ± 0.7`; `3.0 (1 of 5)` where others did not get there, `> 40` where none did, or nothing."""
    reached = outcome[outcome["reached"]]["epochs"]
    if len(outcome) and not len(reached):
        return f"> {outcome['epochs'].max():.0f}"
    return _counted(reached, len(outcome)) if len(outcome) else ""


def _counted(known: pd.Series, every: int) -> str:
    """Mean and spread, and of how many it is unless it is all of them."""
    text = with_spread(known.mean(), known.std()) if len(known) else "not reached"
    return text if len(known) in (0, every) else f"{text} ({len(known)} of {every})"


def _scores(results: DynamicsResults, robot: str) -> Table:
    """Table III.1 or III.2: `model`, `source`, `epochs`, the columns of `SCORES` as texts, `stopped` runs."""
    printed = published()["simulation" if robot == IDEAL else "robot"]
    rows = []
    for model in results.tracked(robot):
        name = model_name(model)
        if model in printed:
            row = dict(zip(published()["columns"], printed[model], strict=True))
            nmse = published()["robot_nmse"].get(model)
            rows.append({"model": name, "source": PRINTED, "nmse": nmse} | row)
        row = {"model": name, "source": HERE, "epochs": epochs_text(results.outcome(robot, model))}
        row["nmse"] = f"{results.robot_error(model):.3f}"
        for column, (task, score) in SCORES.items():
            runs = results.runs(robot, model, task)
            unstable = results.stopped(robot, model, task) == len(runs)
            row[column] = "unstable" if unstable else _spread(runs[score], ".3f")
        count = results.count(robot, model)
        rows.append(row | {"stopped": f"{results.stopped(robot, model)} of {count}"})
    frame = pd.DataFrame(rows)[["model", "source", "epochs", "nmse", *SCORES, "stopped"]]
    frame = frame.drop(columns="nmse") if robot == IDEAL else frame
    return Table(frame, {}, SCORE_HEADINGS, frozenset(np.flatnonzero(frame["source"] == HERE).tolist()))


def _epochs(results: DynamicsResults) -> Table:
    """Epochs to the threshold in simulation, with both losses and both optimisers, as texts by `model`."""
    rows = []
    for model in results.kinds:
        every = {column: results.outcome(IDEAL, model, *how) for column, how in TRAININGS.items()}
        row = {"model": model_name(model)} | {column: epochs_text(its) for column, its in every.items()}
        row["raw_but_last"] = _counted(every["raw"]["epochs_but_last"].dropna(), len(every["raw"]))
        rows.append(row)
    headings = {
        "raw": "raw loss",
        "raw_but_last": "but for the last joint",
        "normalised": "normalised loss",
        "plain": "raw loss, plain Adam",
    }
    return Table(pd.DataFrame(rows)[["model", *headings]], headings=headings)


def _online(results: DynamicsResults) -> Table:
    """Of learning online, mean over seeds: NMSE after one pass, and over the course, by `model`."""
    rows = []
    for model in in_order(results.online["model"].unique()):
        row = {"model": model_name(model)}
        for loss in results.online["loss"].unique():
            scores = results.online_scores(loss).loc[model]
            row |= {f"final_{loss}": scores["final"].mean(), f"course_{loss}": 10.0 ** scores["speed"].mean()}
        rows.append(row)
    frame = pd.DataFrame(rows)
    return Table(frame, dict.fromkeys(frame.columns[1:], ".2g"))


def _bodies(results: DynamicsResults) -> Table:
    """Per `model`: number of learned `links`, and how many of them meet each of `CONDITIONS`, and all."""
    rows = []
    for model in _structures(results):
        met = _of_loss(results, results.links, model)[CONDITIONS]
        row = {"model": model_name(model), "links": len(met)} | met.sum().to_dict()
        rows.append(row | {"possible": int(met.all(axis=1).sum())})
    return Table(pd.DataFrame(rows))


def _links(results: DynamicsResults) -> Table:
    """Learned masses, centres and largest moments of `DETAILED` beside the truth, mean ± std over seeds."""
    its = _of_loss(results, results.links, DETAILED)
    axes = [f"centre_{axis}_m" for axis in "xyz"]
    away = its[axes].to_numpy() - its[[f"true_{axis}" for axis in axes]].to_numpy()
    its = its.assign(away=np.linalg.norm(away, axis=1))
    rows = [
        {
            "link": link,
            "true_mass_kg": group["true_mass_kg"].iloc[0],
            "mass_kg": _spread(group["mass_kg"], ".2f"),
            "centre_m": _spread(group["away"], ".3f"),
            "true_moment_kg_m2": group["true_moment_3_kg_m2"].iloc[0],
            "moment_kg_m2": _spread(group["moment_3_kg_m2"], ".4f"),
        }
        for link, group in its.groupby("link", sort=False)
    ]
    return Table(pd.DataFrame(rows), {"true_mass_kg": ".2f", "true_moment_kg_m2": ".4f"})


def _base_parameters(results: DynamicsResults) -> Table:
    """Base parameters of `DETAILED`: `parameter`, `truth`, `learned` (mean over seeds) and its `std`."""
    by = _of_loss(results, results.base, DETAILED).groupby("parameter", sort=False)
    columns = {"truth": by["truth"].first(), "learned": by["value"].mean(), "std": by["value"].std()}
    return Table(pd.DataFrame(columns).reset_index(), dict.fromkeys(columns, ".4f"))


def _base_errors(results: DynamicsResults) -> Table:
    """Per `model` the median over parameters and seeds of the relative error: `base` parameters, `mass`."""
    rows = []
    for model in _structures(results):
        row: dict[str, object] = {"model": model_name(model)}
        for column, table, learned, true in (
            ("base", results.base, "value", "truth"),
            ("mass", results.links, "mass_kg", "true_mass_kg"),
        ):
            its = _of_loss(results, table, model).query(f"{true} != 0.0")
            row[column] = float(((its[learned] - its[true]) / its[true]).abs().median())
        rows.append(row)
    return Table(pd.DataFrame(rows), {"base": ".1%", "mass": ".1%"})


def _robot_errors(results: DynamicsResults) -> Table:
    """NMSE on the robot's log, mean over seeds: `model`, `joint_1` ..., `mean`; strong: did not learn."""
    models, rows = in_order([*results.known["model"], *results.robot_models]), []
    for model in models:
        known = results.known[results.known["model"] == model].set_index("joint")["nmse"]
        errors = known if len(known) else results.kept_errors(ROBOT, model).mean()
        row = {"model": model_name(model)} | {f"joint_{joint}": error for joint, error in errors.items()}
        rows.append(row | {"mean": errors.mean()})
    frame = pd.DataFrame(rows)
    known = frozenset(place for place, model in enumerate(models) if model in (GROUND_TRUTH, DEFAULT))
    return Table(frame, dict.fromkeys(frame.columns[1:], ".3f"), strong=known)


def _friction(results: DynamicsResults) -> Table:
    """Friction that `DETAILED` learned beside the truth: `joint`; `true_` and learned terms, as text."""
    its = results.friction[results.friction["model"] == f"{DETAILED}{COULOMB}"]
    rows = []
    for joint, group in its.groupby("joint"):
        row: dict[str, object] = {"joint": joint}
        for term, values in group.groupby("term", sort=False):
            row |= {f"true_{term}": values["truth"].iloc[0], term: _spread(values["value"], ".3f")}
        rows.append(row)
    return Table(pd.DataFrame(rows), {"true_viscous": ".3f", "true_coulomb": ".3f"})


def _structures(results: DynamicsResults) -> list[str]:
    return [kind for kind in results.kinds if kind in STRUCTURES]


def _of_loss(results: DynamicsResults, table: pd.DataFrame, model: str) -> pd.DataFrame:
    return table[(table["model"] == model) & (table["loss"] == results.tracking.loss)]


def _spread(values: pd.Series, number_format: str) -> str:
    """Mean ± std, as in the dissertation without a std that would be written as zero."""
    std = values.std()
    return with_spread(
        values.mean(), np.nan if float(format(std, number_format)) == 0.0 else std, number_format
    )
