"""Tables of the dynamics testbed: published beside reproduced, and what was learned beside the truth."""

from itertools import product

import numpy as np
import pandas as pd

from structlearn.reporting.document import Table
from structlearn.reporting.prose import with_spread
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, in_order, model_name
from structlearn.rigid_body.training_grid import LOSSES, OURS, TEXT
from structlearn.testbeds.dynamics.names import FORM_TITLES, IDEAL, REACH, ROBOT, SINE
from structlearn.testbeds.dynamics.page.findings import published
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

PRINTED = "dissertation"

SCORES = {
    "sine_position": (SINE, "position_nmse"),
    "sine_velocity": (SINE, "velocity_nmse"),
    "reach_position": (REACH, "position_nmse"),
    "reach_velocity": (REACH, "velocity_nmse"),
}
"""Columns of tables III.1 and III.2: task and column of the scores."""

SCORE_HEADINGS = {
    "source": "",
    "nmse": "NMSE on the logs",
    "sine_position": "sines, q",
    "sine_velocity": "q̇",
    "reach_position": "reaches, x",
    "reach_velocity": "ẋ",
}

CONDITIONS = ["positive_mass", "positive_definite", "triangle"]
"""On a physically consistent body, columns of `inertia_tables.link_table`."""

DIFFERENCES = ("recursion_n_m", "regressor_n_m", "compiled_n_m")
"""From Pinocchio, of three ways to the same torques."""

DETAILED = "cov"
"""Structure whose learned bodies are listed."""


def tables(results: DynamicsResults) -> dict[str, Table]:
    """Tables of the page by name."""
    found = {
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
    found |= {"robot": _scores(results, ROBOT)} if results.tracked(ROBOT) else {}
    return found | ({"optimisers": _optimisers(results.trials)} if results.trials is not None else {})


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
    for model in in_order({*results.tracked(robot), *printed}):
        name = model_name(model)
        if model in printed:
            row = dict(zip(published()["columns"], printed[model], strict=True))
            nmse = published()["robot_nmse"].get(model)
            rows.append({"model": name, "source": PRINTED, "nmse": nmse} | row)
        for form in (TEXT,) if model in (GROUND_TRUTH, DEFAULT) else (TEXT, OURS):
            outcome, count = results.outcome(robot, model, form), results.count(robot, model, form)
            if count or len(outcome):
                source = "here" if model in (GROUND_TRUTH, DEFAULT) else FORM_TITLES[form].lower()
                row = {"model": name, "source": source, "epochs": epochs_text(outcome)}
                row["nmse"] = f"{results.robot_error(model, form).mean():.3f}"
                for column, (task, score) in SCORES.items():
                    row[column] = _score(results.runs(robot, model, task, form), score)
                rows.append(row | {"stopped": f"{results.stopped(robot, model, form)} of {count}"})
    frame = pd.DataFrame(rows)[["model", "source", "epochs", "nmse", *SCORES, "stopped"]]
    frame = frame.drop(columns="nmse") if robot == IDEAL else frame
    return Table(frame, {}, SCORE_HEADINGS, frozenset(np.flatnonzero(frame["source"] != PRINTED).tolist()))


def _score(runs: pd.DataFrame, score: str) -> str:
    """Mean and spread; a model that did not meet the criterion was not tracked with."""
    if runs.empty:
        return "not tested"
    return "unstable" if (runs["stopped"] != "").all() else _spread(runs[score], ".3f")


def _epochs(results: DynamicsResults) -> Table:
    """Epochs to the threshold in simulation, in both forms, as texts by `model`."""
    rows = []
    for model in results.kinds:
        text, ours = (results.outcome(IDEAL, model, form) for form in (TEXT, OURS))
        row = {"model": model_name(model), "text": epochs_text(text), "ours": epochs_text(ours)}
        row["text_but_last"] = _counted(text["epochs_but_last"].dropna(), len(text)) if len(text) else ""
        rows.append(row)
    headings = {"text": "as published", "text_but_last": "but for the last joint", "ours": "our training"}
    return Table(pd.DataFrame(rows)[["model", *headings]], headings=headings)


def _optimisers(trials: pd.DataFrame) -> Table:
    """Epochs by kind, and how DeLaN ended, a row per trial of our optimiser."""
    kinds = in_order(name.removeprefix("epochs_") for name in trials if name.startswith("epochs_"))
    columns = {f"epochs_{kind}": model_name(kind) for kind in kinds}
    columns["worst_delan"] = f"{model_name('delan')}, worst NMSE"
    frame = trials.groupby("variant", sort=False)[list(columns)].mean().reset_index()
    return Table(frame, dict.fromkeys(columns, ".1f") | {"worst_delan": ".2g"}, columns)


def _online(results: DynamicsResults) -> Table:
    """Of learning online, mean over seeds: NMSE after one pass, and over the course, by `model`."""
    rows = []
    for model in in_order(results.online["model"].unique()):
        row = {"model": model_name(model)}
        for form, loss in LOSSES.items():
            scores = results.online_scores(form).loc[model]
            row |= {f"final_{loss}": scores["final"].mean(), f"course_{loss}": 10.0 ** scores["speed"].mean()}
        rows.append(row)
    frame = pd.DataFrame(rows)
    return Table(frame, dict.fromkeys(frame.columns[1:], ".2g"))


def _bodies(results: DynamicsResults) -> Table:
    """Per `model`: number of learned `links`, and how many of them meet each of `CONDITIONS`, and all."""
    rows = []
    for model in _structures(results):
        met = _of(results.links, model)[CONDITIONS]
        row = {"model": model_name(model), "links": len(met)} | met.sum().to_dict()
        rows.append(row | {"possible": int(met.all(axis=1).sum())})
    return Table(pd.DataFrame(rows))


def _links(results: DynamicsResults) -> Table:
    """Learned masses, centres and largest moments of `DETAILED` beside the truth, mean ± std over seeds."""
    its = _of(results.links, DETAILED)
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
    by = _of(results.base, DETAILED).groupby("parameter", sort=False)
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
            its = _of(table, model).query(f"{true} != 0.0")
            row[column] = float(((its[learned] - its[true]) / its[true]).abs().median())
        rows.append(row)
    return Table(pd.DataFrame(rows), {"base": ".1%", "mass": ".1%"})


def _robot_errors(results: DynamicsResults) -> Table:
    """NMSE on robots' logs, mean over robots: `model`, `form`, `joint_1` ..., `mean`; strong: known."""
    rows = []
    for model in in_order(results.known["model"].unique()):
        errors = results.known[results.known["model"] == model].groupby("joint")["nmse"].mean()
        rows.append(_joint_errors(model, "", errors))
    known = frozenset(range(len(rows)))
    for model, form in product(results.robot_models, (TEXT, OURS)):
        errors = results.kept_errors(ROBOT, model, form)
        if len(errors):
            rows.append(_joint_errors(model, FORM_TITLES[form].lower(), errors.mean()))
    frame = pd.DataFrame(rows)
    return Table(frame, dict.fromkeys(frame.columns[2:], ".3f"), strong=known)


def _joint_errors(model: str, form: str, errors: pd.Series) -> dict[str, object]:
    joints = {f"joint_{joint}": error for joint, error in errors.items()}
    return {"model": model_name(model), "form": form} | joints | {"mean": errors.mean()}


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


def _of(table: pd.DataFrame, model: str) -> pd.DataFrame:
    """Results of a model trained as published."""
    return table[(table["model"] == model) & (table["form"] == TEXT)]


def _spread(values: pd.Series, number_format: str) -> str:
    """Mean ± std, as in the dissertation without a std that would be written as zero."""
    std = values.std()
    return with_spread(
        values.mean(), np.nan if float(format(std, number_format)) == 0.0 else std, number_format
    )
