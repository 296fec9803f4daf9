"""The page of the dynamics testbed: its tables, numbers for its sentences, and their sources.

Tables show published values beside reproduced ones, and learned values beside true ones. Those over seeds or
robots are pivots of the results; others show this run's models.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.dynamics.names import FORM_TITLES, IDEAL, REACH, ROBOT, SINE
from dissertation.dynamics.page.findings import RIVALS, published
from dissertation.dynamics.protocol.forms import CHOSEN, FORMS
from dissertation.dynamics.protocol.results import CONDITIONS, SETTLED_SHARE, STOPPED_NMSE
from dissertation.dynamics.protocol.training_choice import TABLE, choose, mean_scores
from dissertation.dynamics.protocol.truth import FRICTION_MODELS
from dissertation.dynamics.world.controlled_arm import OVERSPEED
from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Population, Results
from dissertation.evidence.studies import Study, rests_on
from dissertation.simulation.individuals import Individual, differences
from structlearn.core.params import read_values
from structlearn.reporting.document import Source, Table
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import with_spread
from structlearn.rigid_body.dynamics_training import LOSSES
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, model_name, models_in_order

ROBOTS_STUDY = "dynamics/robots"  # further seeds and robots

SOURCES = {
    "log": Source("data/runs/dynamics/perturbed.parquet", "dynamics_import_logs"),
    "models": Source("data/dynamics/models", "dynamics_train"),
    "scores": Source("data/dynamics/tracking", "dynamics_track"),
    "online": Source("data/dynamics/online", "dynamics_online"),
    "results": Source("data/results/dynamics.parquet", "dynamics_results"),
    "choice": Source(TABLE.as_posix(), "python -m dissertation.dynamics.protocol.training_choice"),
}

PRINTED = "dissertation"

SCORES = {
    "sine_position": (SINE, "position_nmse", "sines, q"),
    "sine_velocity": (SINE, "velocity_nmse", "q̇"),
    "reach_position": (REACH, "position_nmse", "reaches, x"),
    "reach_velocity": (REACH, "velocity_nmse", "ẋ"),
}
"""Columns of tables III.1 and III.2: task, quantity of the results, heading."""

DETAILED = "cov"  # structure whose learned parameters are listed
KNOWN = (GROUND_TRUTH, DEFAULT)

Raw = Mapping[str, pd.DataFrame]
"""Tables of this run, see `files.TABLES`; also `agreement` by URDF, `residuals` and `choice` of trainings."""


def dynamics_page(
    population: Population, find: Findings, raw: Raw, chosen: Mapping[str, Any], study: Study | None
) -> JudgedDocument:
    """Page with its tables and verdicts; figures come from `figures.drawings` and `arm_still`.

    `chosen`: parameters by key of `params.yaml`.
    """
    results = population.results
    shown, seeds = tables(results, raw), results.rows("nmse", arm=ROBOT)["seed"]
    facts = {
        **find.numbers(),
        "chosen": chosen,
        "training": chosen["train_dynamics"],
        "published": published(),
        "untested": read_values(Path(__file__).with_name("untested.yaml")),
        "overspeed": OVERSPEED,
        "stopped_nmse": STOPPED_NMSE,
        "settled_share": SETTLED_SHARE,
        "robots": seeds.nunique(),
        "robots_of_this_run": population.one.table["seed"].nunique(),
        "moved": population.moved,
        "joints": int(raw["errors"]["joint"].max()),
        "stopped": {arm: _stopped(results, arm) for arm in (IDEAL, ROBOT)},
        "unmet": {arm: {form: _unmet(results, arm, form) for form in FORMS} for arm in (IDEAL, ROBOT)},
        "parameters_of_links": 10 * raw["links"]["link"].nunique(),
        "base_parameters": raw["base"]["parameter"].nunique(),
        "best_base": min(shown["base_errors"].frame.to_dict("records"), key=lambda row: row["base"]),
        "distance_m": np.linalg.norm(chosen["record_motion"].payload.point_m),
        "pick_up_s": pick_up_s(chosen),
    }
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return JudgedDocument(
        template="dynamics.html.jinja",
        package=__package__,
        stage="dynamics_report",
        facts=facts,
        tables=shown | {"differences": _differences(chosen["perturbed_robot"])},
        judged=judge(claims, find, facts),
        sources=SOURCES,
        parameters=chosen,
        recordings="../rerun/dynamics",
        simulated=True,
        basis=rests_on(ROBOTS_STUDY, study),
    )


def pick_up_s(chosen: Mapping[str, Any]) -> float:
    """Time in s at which payloads are picked up."""
    motion = chosen["arm_motion"].used.cut(chosen["perturbed_robot"].log_s)
    return chosen["record_motion"].payload.pick_up_s(motion.duration_s)


def _stopped(results: Results, arm: str) -> list[str]:
    """Models with stopped runs, sines and reaches, e.g. `DeLaN (plain loss) 4 of 10`."""
    rows = results.rows("stopped", arm=arm).groupby(["model", "form"], sort=False)["value"]
    return [
        f"{model_name(model)} ({FORM_TITLES[form].lower()}) {its.sum():.0f} of {len(its)}"
        for (model, form), its in rows
        if its.any()
    ]


def _unmet(results: Results, arm: str, form: str) -> list[str]:
    """Models that missed the criterion with some seed or on some robot."""
    met = results.wide("met", "model", arm=arm, form=form).reindex(columns=RIVALS)
    return [model_name(model) for model in met if (met[model] == 0.0).any()]


def tables(results: Results, raw: Raw) -> dict[str, Table]:
    """Tables of the results, keyed by name."""
    agreed = {"largest_n_m": ".0f", "regressor_n_m": ".1e", "compiled_n_m": ".1e"}
    return {
        "simulation": _scores(results, IDEAL),
        "robot": _scores(results, ROBOT),
        "epochs": _epochs(results),
        "online": _online(results),
        "choice": _choice(raw["choice"]),
        "bodies": _bodies(raw["links"]),
        "links": _links(raw["links"]),
        "base_parameters": _base_parameters(raw["base"]),
        "base_errors": _base_errors(raw),
        "robot_errors": _robot_errors(raw),
        "friction": _friction(raw["friction"]),
        "agreement": Table(raw["agreement"], agreed),
    }


def _scores(results: Results, arm: str) -> Table:
    """Table III.1 or III.2: `model`, `source`, `epochs`, columns of `SCORES` as text, `stopped` runs."""
    printed = published()["simulation" if arm == IDEAL else "robot"]
    stopped, nmse = (
        results.rows(name, arm=arm).groupby(["model", "form"])["value"] for name in ("stopped", "nmse")
    )
    columns = {
        name: [results.wide(one, ["model", "form"], arm=arm, task=task) for one in (quantity, "stopped")]
        for name, (task, quantity, _) in SCORES.items()
    }
    counts, halted, errors, epochs = stopped.size(), stopped.sum(), nmse.mean(), _epochs_text(results, arm)
    rows = []
    for model in models_in_order({*counts.index.unique("model"), *printed}):
        name = model_name(model)
        if model in printed:
            row = dict(zip(published()["columns"], printed[model], strict=True))
            rows.append(
                {"model": name, "source": PRINTED, "nmse": published()["robot_nmse"].get(model)} | row
            )
        for form in ("",) if model in KNOWN else FORMS:
            key = model, form
            if key not in counts and key not in epochs:
                continue
            row = {"model": name, "source": FORM_TITLES[form].lower() if form else "here"}
            row |= {"epochs": epochs.get(key, ""), "nmse": f"{errors.get(key, np.nan):.3f}"}
            for column, its in columns.items():
                row[column] = _score(*(one[key] for one in its)) if key in its[0] else "not tested"
            rows.append(row | {"stopped": f"{halted.get(key, 0):.0f} of {counts.get(key, 0)}"})
    frame = pd.DataFrame(rows)[["model", "source", "epochs", "nmse", *SCORES, "stopped"]]
    frame = frame.drop(columns="nmse") if arm == IDEAL else frame
    headings = {"source": "", "nmse": "NMSE on the logs"} | {name: one[-1] for name, one in SCORES.items()}
    return Table(frame, {}, headings, frozenset(np.flatnonzero(frame["source"] != PRINTED).tolist()))


def _score(scores: pd.Series, stopped: pd.Series) -> str:
    """Mean and standard deviation as text."""
    return "unstable" if (stopped.dropna() == 1.0).all() else _spread(scores.dropna(), ".3f")


def _epochs_text(results: Results, arm: str) -> dict[tuple[str, str], str]:
    """Epochs to the threshold by model and form, e.g. `2.0 ± 0.7`, `3.0 (1 of 5)`, `> 40` if none did."""
    epochs, reached = (results.wide(name, ["model", "form"], arm=arm) for name in ("epochs", "reached"))
    return {
        key: _counted(epochs[key][reached[key] == 1.0], epochs[key].count()) or f"> {epochs[key].max():.0f}"
        for key in epochs
    }


def _counted(known: pd.Series, every: int) -> str:
    """Mean and standard deviation as text, with their number unless all are known; empty if none is."""
    text = with_spread(known.mean(), known.std()) if len(known) else ""
    return text if len(known) in (0, every) else f"{text} ({len(known)} of {every})"


def _epochs(results: Results) -> Table:
    """Epochs to the threshold in simulation as text, by `model` and form, and on all joints but the last."""
    epochs = _epochs_text(results, IDEAL)
    but_last = results.rows("epochs_but_last", arm=IDEAL, form="plain").groupby("model")["value"]
    every = results.rows("epochs", arm=IDEAL, form="plain").groupby("model")["value"].size()
    shown = {model: _counted(its, every[model]) for model, its in but_last}
    rows = [
        (model_name(model), *(epochs.get((model, form), "") for form in FORMS), shown.get(model, ""))
        for model in models_in_order({model for model, _ in epochs})
    ]
    headings: dict[str, str] = {form: title.lower() for form, title in FORM_TITLES.items()}
    headings |= {"but_last": "plain loss, but for the last joint"}
    return Table(pd.DataFrame(rows, columns=["model", *headings]), headings=headings)


def _by_model(columns: Mapping[str, pd.Series], number_format: str = "") -> Table:
    """Table with one row per model, in table order."""
    frame = pd.DataFrame(columns)
    frame = (
        frame.loc[models_in_order(frame.index)].rename(index=model_name).rename_axis("model").reset_index()
    )
    return Table(frame, dict.fromkeys(columns, number_format) if number_format else {})


def _online(results: Results) -> Table:
    """NMSE of online learning by `model`, geometric means: over the course, in the middle, at the end."""
    means = {
        f"{when}_{loss}": np.exp(np.log(results.wide(f"online_{when}", "model", loss=loss)).mean())
        for loss in reversed(LOSSES)
        for when in ("course", "half", "final")
    }
    return _by_model(means, ".2g")


def _choice(table: pd.DataFrame) -> Table:
    """Chosen training by `model`, its `epochs` on the tuning motion, and the fewest with the `raw` loss."""
    means = mean_scores(table)["epochs"]
    columns: dict[str, pd.Series] = {
        name: pd.Series({model: getattr(its, name) for model, its in choose(table).items()})
        for name in ("loss", "batch", "rate")
    }
    raw = means.xs("raw", level="loss")
    columns |= {"epochs": means.groupby("model").min(), "raw": raw.groupby("model").min()}
    headings = {"epochs": "epochs of 60 s", "raw": "with the raw loss at best"}
    return Table(_by_model(columns).frame, {"rate": "g", "epochs": ".1f", "raw": ".1f"}, headings)


def _bodies(links: pd.DataFrame) -> Table:
    """Number of learned `links` by `model`, and of those that meet each of `CONDITIONS`, and all."""
    its = links[links["form"] == CHOSEN]
    met = its[CONDITIONS].assign(possible=its[CONDITIONS].all(axis=1)).groupby(its["model"])
    return _by_model({"links": met.size()} | dict(met.sum()))


def _base_errors(raw: Raw) -> Table:
    """Median relative error by `model`, over parameters and seeds: `base` parameters, `mass`."""
    columns = {}
    for name, table, learned, true in (
        ("base", raw["base"], "value", "truth"),
        ("mass", raw["links"], "mass_kg", "true_mass_kg"),
    ):
        its = table.query(f"form == @CHOSEN and {true} != 0.0")
        columns[name] = ((its[learned] - its[true]) / its[true]).abs().groupby(its["model"]).median()
    return _by_model(columns, ".1%")


def _links(links: pd.DataFrame) -> Table:
    """Masses, centres and largest moments learned by `DETAILED` beside the truth, mean ± std over seeds."""
    its = links.query("form == @CHOSEN and model == @DETAILED")
    axes = [f"centre_{axis}_m" for axis in "xyz"]
    away = its[axes].to_numpy() - its[[f"true_{axis}" for axis in axes]].to_numpy()
    by = its.assign(away=np.linalg.norm(away, axis=1)).groupby("link", sort=False)
    columns = {
        "true_mass_kg": by["true_mass_kg"].first(),
        "mass_kg": by["mass_kg"].agg(_spread, ".2f"),
        "centre_m": by["away"].agg(_spread, ".3f"),
        "true_moment_kg_m2": by["true_moment_3_kg_m2"].first(),
        "moment_kg_m2": by["moment_3_kg_m2"].agg(_spread, ".4f"),
    }
    formats = {"true_mass_kg": ".2f", "true_moment_kg_m2": ".4f"}
    return Table(pd.DataFrame(columns).reset_index(), formats)


def _base_parameters(base: pd.DataFrame) -> Table:
    """Base parameters of `DETAILED`: `parameter`, `truth`, `learned` (mean over seeds) and its `std`."""
    by = base.query("form == @CHOSEN and model == @DETAILED").groupby("parameter", sort=False)
    columns = {"truth": by["truth"].first(), "learned": by["value"].mean(), "std": by["value"].std()}
    return Table(pd.DataFrame(columns).reset_index(), dict.fromkeys(columns, ".4f"))


def _robot_errors(raw: Raw) -> Table:
    """NMSE on this run's logs, mean over robots: `model`, `form`, `joint_1` ..., `mean`; bold: known."""
    errors = raw["errors"][raw["errors"]["arm"] == ROBOT]
    kept = errors[errors["epoch"] == errors.groupby(["model", "form"])["epoch"].transform("max")]
    every = pd.concat([raw["known"].assign(form=""), kept])
    joints = every.pivot_table("nmse", ["model", "form"], "joint").add_prefix("joint_")
    order = [
        (model, form) for model in models_in_order(joints.index.unique("model")) for form in ("", *FORMS)
    ]
    frame = joints.assign(mean=joints.mean(axis=1)).reindex(order).dropna().reset_index()
    strong = frozenset(np.flatnonzero(frame["form"] == "").tolist())
    words = {"model": frame["model"].map(model_name), "form": frame["form"].replace(FORM_TITLES).str.lower()}
    return Table(frame.assign(**words), dict.fromkeys(frame.columns[2:], ".3f"), strong=strong)


def _friction(friction: pd.DataFrame) -> Table:
    """Friction learned by `DETAILED` beside the truth, by `joint`: `true_<term>` and `<term>`, as text."""
    columns: dict[str, pd.Series] = {}
    for term, rows in friction[friction["model"] == FRICTION_MODELS[-1]].groupby("term", sort=False):
        joints = rows.groupby("joint")
        columns |= {f"true_{term}": joints["truth"].agg(_spread, ".3f")}
        columns |= {term: joints["value"].agg(_spread, ".3f")}
    return Table(pd.DataFrame(columns).reset_index())


def _differences(robots: Individual) -> Table:
    """What differs between robots, see `individuals.differences`."""
    return Table(differences(robots), dict.fromkeys(("median", "lowest", "highest"), ".2g"))


def _spread(values: pd.Series, number_format: str) -> str:
    """Mean ± std as text; like the dissertation, without a std that rounds to zero."""
    std = values.std()
    return with_spread(
        values.mean(), np.nan if float(format(std, number_format)) == 0.0 else std, number_format
    )
