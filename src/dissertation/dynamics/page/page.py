"""The page of the dynamics testbed: its tables, numbers for its sentences, and their sources.

Tables show published values beside reproduced ones, and learned values beside true ones.
"""

from collections.abc import Mapping
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.dynamics.names import FORM_TITLES, IDEAL, REACH, ROBOT, SINE
from dissertation.dynamics.page.findings import (
    IMPLEMENTATIONS,
    ROBOTS_STUDY,
    SETTLED_SHARE,
    STOPPED_NMSE,
    STUDIED,
    DynamicsResults,
    published,
    unmet,
)
from dissertation.dynamics.protocol.trainings import LOSSES, OURS, PUBLISHED
from dissertation.dynamics.world.controlled_arm import OVERSPEED
from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.studies import rests_on
from structlearn.reporting.document import Source, Table
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import with_spread
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, model_name, models_in_order

SOURCES = {
    "log": Source("data/runs/dynamics/perturbed.parquet", "dynamics_import_logs"),
    "models": Source("data/dynamics/models", "dynamics_train"),
    "scores": Source("data/dynamics/tracking", "dynamics_track"),
    "online": Source("data/dynamics/online", "dynamics_online"),
}

PRINTED = "dissertation"

SCORES = {
    "sine_position": (SINE, "position_nmse", "sines, q"),
    "sine_velocity": (SINE, "velocity_nmse", "q̇"),
    "reach_position": (REACH, "position_nmse", "reaches, x"),
    "reach_velocity": (REACH, "velocity_nmse", "ẋ"),
}
"""Columns of tables III.1 and III.2: task, column of the scores, heading."""

CONDITIONS = ["positive_mass", "positive_definite", "triangle"]
"""Conditions of physical consistency: columns of `base_parameters.link_table`."""

DETAILED = "cov"  # structure whose learned parameters are listed


def dynamics_page(results: DynamicsResults, find: Findings) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.drawings` and `arm_still`."""
    shown, chosen = tables(results), results.chosen
    after = results.payload[results.payload["time_s"] > results.pick_up_s]
    by_model = {
        name: {row["model"]: row for row in shown[name].frame.to_dict("records")}
        for name in ("epochs", "online", "bodies", "base_errors")
    }
    facts = {
        **find.numbers(),
        **{name: by_model[name] for name in ("epochs", "online")},
        "results": results,
        "chosen": chosen,
        "training": chosen["train_dynamics"],
        "published": published(),
        "overspeed": OVERSPEED,
        "stopped_nmse": STOPPED_NMSE,
        "settled_share": SETTLED_SHARE,
        "joints": int(results.errors["joint"].max()),
        "stopped": {arm: _stopped(results, arm) for arm in (IDEAL, ROBOT)},
        "unmet": {
            form: {arm: [model_name(model) for model in unmet(results, arm, form)] for arm in (IDEAL, ROBOT)}
            for form in FORM_TITLES
        },
        "parameters_of_links": 10 * results.links["link"].nunique(),
        "friction": _median_friction(results),
        "payload": {
            "fixed": after["nmse_fixed"].mean(),
            "learned": after["nmse_learned"].mean(),
            "distance_m": np.linalg.norm(chosen["record_motion"].payload.point_m),
        },
        "impossible": [
            f"{model} {row['links'] - row['possible']} of {row['links']}"
            for model, row in by_model["bodies"].items()
            if row["possible"] < row["links"]
        ],
        "best_base": min(by_model["base_errors"].values(), key=lambda row: row["base"]),
    }
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return JudgedDocument(
        template="dynamics.html.jinja",
        package=__package__,
        stage="dynamics_report",
        facts=facts,
        tables=shown,
        judged=judge(claims, find, facts),
        sources=SOURCES,
        parameters=chosen,
        recordings="../rerun/dynamics",
        simulated=True,
        basis=rests_on(ROBOTS_STUDY, results.study),
    )


def _stopped(results: DynamicsResults, arm: str) -> list[str]:
    """Models with stopped runs, e.g. `DeLaN (our training) 4 of 10`."""
    return [
        f"{model_name(model)} ({title.lower()}) {stopped} of {count}"
        for model, (form, title) in product(results.tracked(arm), FORM_TITLES.items())
        for stopped, count in [results.stopped(arm, model, form)]
        if stopped
    ]


def _median_friction(results: DynamicsResults) -> dict[str, float]:
    """Median relative errors of friction coefficients; `factor`: ratio learned with viscous friction only."""
    known = results.friction
    ratio = known["value"] / known["truth"]
    median, off = (
        one.groupby([known["model"], known["term"]]).median() for one in (ratio, (ratio - 1.0).abs())
    )
    return off[f"{DETAILED}{COULOMB}"].to_dict() | {"factor": median[DETAILED, "viscous"]}


def tables(results: DynamicsResults) -> dict[str, Table]:
    """Tables of the page, and those that a study collects from each cell, keyed by name."""
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
        "agreement": Table(results.agreement, dict.fromkeys(IMPLEMENTATIONS, ".1e") | {"largest_n_m": ".0f"}),
    }
    if results.tracked(ROBOT):
        found["robot"] = _scores(results, ROBOT)
    found |= {name: Table(getattr(results, name)) for name in STUDIED}
    return found | {"online_scores": Table(results.learned_online)}


def _scores(results: DynamicsResults, robot: str) -> Table:
    """Table III.1 or III.2: `model`, `source`, `epochs`, columns of `SCORES` as text, `stopped` runs."""
    printed = published()["simulation" if robot == IDEAL else "robot"]
    rows = []
    for model in models_in_order({*results.tracked(robot), *printed}):
        name, known = model_name(model), model in (GROUND_TRUTH, DEFAULT)
        if model in printed:
            row = dict(zip(published()["columns"], printed[model], strict=True))
            nmse = published()["robot_nmse"].get(model)
            rows.append({"model": name, "source": PRINTED, "nmse": nmse} | row)
        for form in (PUBLISHED,) if known else (PUBLISHED, OURS):
            outcome = results.outcome(robot, model, form)
            stopped, count = results.stopped(robot, model, form)
            if count or len(outcome):
                source = "here" if known else FORM_TITLES[form].lower()
                row = {"model": name, "source": source, "epochs": _epochs_text(outcome)}
                row["nmse"] = f"{results.robot_error(model, form).mean():.3f}"
                for column, (task, score, _) in SCORES.items():
                    row[column] = _score(results.runs(robot, model, task, form), score)
                rows.append(row | {"stopped": f"{stopped} of {count}"})
    frame = pd.DataFrame(rows)[["model", "source", "epochs", "nmse", *SCORES, "stopped"]]
    frame = frame.drop(columns="nmse") if robot == IDEAL else frame
    headings = {"source": "", "nmse": "NMSE on the logs"} | {name: one[-1] for name, one in SCORES.items()}
    return Table(frame, {}, headings, frozenset(np.flatnonzero(frame["source"] != PRINTED).tolist()))


def _score(runs: pd.DataFrame, score: str) -> str:
    """Mean and standard deviation as text; a model that missed the criterion has no runs."""
    if runs.empty:
        return "not tested"
    return "unstable" if (runs["stopped"] != "").all() else _spread(runs[score], ".3f")


def _epochs(results: DynamicsResults) -> Table:
    """Epochs to the threshold in simulation as text, by `model` and form."""
    rows = []
    for model in results.kinds:
        first, ours = (results.outcome(IDEAL, model, form) for form in (PUBLISHED, OURS))
        but_last = _counted(first["epochs_but_last"].dropna(), len(first)) if len(first) else ""
        rows.append((model_name(model), _epochs_text(first), but_last, _epochs_text(ours)))
    headings = {
        PUBLISHED: "as published",
        "published_but_last": "but for the last joint",
        OURS: "our training",
    }
    return Table(pd.DataFrame(rows, columns=["model", *headings]), headings=headings)


def _epochs_text(outcome: pd.DataFrame) -> str:
    """Epochs as text, e.g. `2.0 ± 0.7`, `3.0 (1 of 5)` if not all reached it, `> 40` if none did."""
    reached = outcome[outcome["reached"]]["epochs"]
    if len(outcome) and not len(reached):
        return f"> {outcome['epochs'].max():.0f}"
    return _counted(reached, len(outcome)) if len(outcome) else ""


def _counted(known: pd.Series, every: int) -> str:
    """Mean and standard deviation as text, with their number unless all are known."""
    text = with_spread(known.mean(), known.std()) if len(known) else "not reached"
    return text if len(known) in (0, every) else f"{text} ({len(known)} of {every})"


def _by_model(columns: Mapping[str, pd.Series], number_format: str = "") -> Table:
    """Table with one row per model, in table order."""
    frame = pd.DataFrame(columns)
    frame = (
        frame.loc[models_in_order(frame.index)].rename(index=model_name).rename_axis("model").reset_index()
    )
    return Table(frame, dict.fromkeys(columns, number_format) if number_format else {})


def _online(results: DynamicsResults) -> Table:
    """Online learning by `model`, mean over seeds: NMSE after one pass, and over the course."""
    columns: dict[str, pd.Series] = {}
    for form, loss in LOSSES.items():
        means = results.online_scores(form).groupby("model").mean()
        columns |= {f"final_{loss}": means["final"], f"course_{loss}": 10.0 ** means["speed"]}
    return _by_model(columns, ".2g")


def _bodies(results: DynamicsResults) -> Table:
    """Number of learned `links` by `model`, and of those that meet each of `CONDITIONS`, and all."""
    its = results.links.query("form == @PUBLISHED")
    met = its[CONDITIONS].assign(possible=its[CONDITIONS].all(axis=1)).groupby(its["model"])
    return _by_model({"links": met.size()} | dict(met.sum()))


def _base_errors(results: DynamicsResults) -> Table:
    """Median relative error by `model`, over parameters and seeds: `base` parameters, `mass`."""
    columns = {}
    for name, table, learned, true in (
        ("base", results.base, "value", "truth"),
        ("mass", results.links, "mass_kg", "true_mass_kg"),
    ):
        its = table.query(f"form == @PUBLISHED and {true} != 0.0")
        columns[name] = ((its[learned] - its[true]) / its[true]).abs().groupby(its["model"]).median()
    return _by_model(columns, ".1%")


def _links(results: DynamicsResults) -> Table:
    """Masses, centres and largest moments learned by `DETAILED` beside the truth, mean ± std over seeds."""
    its = results.links.query("form == @PUBLISHED and model == @DETAILED")
    axes = [f"centre_{axis}_m" for axis in "xyz"]
    away = its[axes].to_numpy() - its[[f"true_{axis}" for axis in axes]].to_numpy()
    links = its.assign(away=np.linalg.norm(away, axis=1)).groupby("link", sort=False)
    columns = {
        "true_mass_kg": links["true_mass_kg"].first(),
        "mass_kg": links["mass_kg"].agg(_spread, ".2f"),
        "centre_m": links["away"].agg(_spread, ".3f"),
        "true_moment_kg_m2": links["true_moment_3_kg_m2"].first(),
        "moment_kg_m2": links["moment_3_kg_m2"].agg(_spread, ".4f"),
    }
    formats = {"true_mass_kg": ".2f", "true_moment_kg_m2": ".4f"}
    return Table(pd.DataFrame(columns).reset_index(), formats)


def _base_parameters(results: DynamicsResults) -> Table:
    """Base parameters of `DETAILED`: `parameter`, `truth`, `learned` (mean over seeds) and its `std`."""
    its = results.base.query("form == @PUBLISHED and model == @DETAILED")
    by = its.groupby("parameter", sort=False)
    columns = {"truth": by["truth"].first(), "learned": by["value"].mean(), "std": by["value"].std()}
    return Table(pd.DataFrame(columns).reset_index(), dict.fromkeys(columns, ".4f"))


def _robot_errors(results: DynamicsResults) -> Table:
    """NMSE on robots' logs, mean over robots: `model`, `form`, `joint_1` ..., `mean`; bold: known models."""
    errors = results.errors[results.errors["arm"] == ROBOT]
    kept = errors[errors["epoch"] == errors.groupby(["model", "form"])["epoch"].transform("max")]
    known_errors = results.known[results.known["seed"].isin(kept["seed"])]
    every = pd.concat([known_errors.assign(form=""), kept])
    joints = every.pivot_table("nmse", ["model", "form"], "joint").add_prefix("joint_")
    known = [(model, "") for model in models_in_order(results.known["model"].unique())]
    order = [key for key in (*known, *product(results.robot_models, FORM_TITLES)) if key in joints.index]
    frame = joints.assign(mean=joints.mean(axis=1)).loc[order].reset_index()
    words = {"model": frame["model"].map(model_name), "form": frame["form"].replace(FORM_TITLES).str.lower()}
    formats = dict.fromkeys(frame.columns[2:], ".3f")
    return Table(frame.assign(**words), formats, strong=frozenset(range(len(known))))


def _friction(results: DynamicsResults) -> Table:
    """Friction learned by `DETAILED` beside the truth, by `joint`: `true_<term>` and `<term>`, as text."""
    its = results.friction[results.friction["model"] == f"{DETAILED}{COULOMB}"]
    columns: dict[str, pd.Series] = {}
    for term, rows in its.groupby("term", sort=False):
        joints = rows.groupby("joint")
        columns |= {f"true_{term}": joints["truth"].first(), term: joints["value"].agg(_spread, ".3f")}
    formats = {"true_viscous": ".3f", "true_coulomb": ".3f"}
    return Table(pd.DataFrame(columns).reset_index(), formats)


def _spread(values: pd.Series, number_format: str) -> str:
    """Mean ± std as text; like the dissertation, without a std that rounds to zero."""
    std = values.std()
    return with_spread(
        values.mean(), np.nan if float(format(std, number_format)) == 0.0 else std, number_format
    )
