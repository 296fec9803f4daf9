"""The page of the dynamics testbed: what its sentences name, and where that comes from."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from structlearn.core.params import Parameters
from structlearn.reporting.claims import judge, read_claims
from structlearn.reporting.document import Document, Source, Table, environment
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.model_names import COULOMB, model_name
from structlearn.testbeds.dynamics.names import FORM_TITLES, IDEAL, ROBOT
from structlearn.testbeds.dynamics.page.findings import published, unmet
from structlearn.testbeds.dynamics.protocol.scored_results import SETTLED_SHARE, STOPPED_NMSE, DynamicsResults
from structlearn.testbeds.dynamics.world.controlled_arm import OVERSPEED

SOURCES = {
    "log": Source("data/runs/dynamics/stand_in.parquet", "dynamics_import_logs"),
    "models": Source("data/dynamics/models", "dynamics_train"),
    "scores": Source("data/dynamics/tracking", "dynamics_track"),
    "online": Source("data/dynamics/online", "dynamics_online"),
}


def dynamics_page(
    results: DynamicsResults,
    find: Findings,
    shown: Mapping[str, Table],
    parameters: Mapping[str, Parameters],
) -> Document:
    """The page, with parameters by their key; its figures are those of `figures.drawings`, and `still`."""
    facts = find.numbers() | _named(results) | _from_tables(shown)
    claims = read_claims(Path(__file__).with_name("claims.yaml"))
    return Document(
        template="dynamics.html.jinja",
        package=__package__,
        stage="dynamics_report",
        facts=facts,
        tables=shown,
        judged=judge(claims, find, environment(__package__), facts),
        sources=SOURCES,
        parameters=parameters,
        recordings="../rerun/dynamics",
        simulated=True,
    )


def _named(results: DynamicsResults) -> dict[str, object]:
    """Settings and lists of models that sentences name."""
    after = results.payload[results.payload["time_s"] > results.pick_up_s]
    return {
        "results": results,
        "published": published(),
        "training": results.training,
        "overspeed": OVERSPEED,
        "stopped_nmse": STOPPED_NMSE,
        "settled_share": SETTLED_SHARE,
        "tried": results.trials is not None,
        "joints": int(results.errors["joint"].max()),
        "stopped": {arm: _stopped(results, arm) for arm in (IDEAL, ROBOT)},
        "unmet": {
            form: {arm: [model_name(model) for model in unmet(results, arm, form)] for arm in (IDEAL, ROBOT)}
            for form in FORM_TITLES
        },
        "parameters_of_links": 10 * results.links["link"].nunique(),
        "friction": _friction(results),
        "payload": {
            "fixed": after["nmse_fixed"].mean(),
            "learned": after["nmse_learned"].mean(),
            "distance_m": np.linalg.norm(results.carried.point_m),
        },
    }


def _from_tables(shown: Mapping[str, Table]) -> dict[str, object]:
    """Rows of tables that sentences name."""
    names = ("epochs", "online", "bodies", "base_errors")
    epochs, online, bodies, base = (shown[name].frame.to_dict("records") for name in names)
    return {
        "epochs": {row["model"]: row for row in epochs},
        "online": {row["model"]: row for row in online},
        "impossible": [
            f"{row['model']} {row['links'] - row['possible']} of {row['links']}"
            for row in bodies
            if row["possible"] < row["links"]
        ],
        "best_base": min(base, key=lambda row: row["base"]),
    }


def _stopped(results: DynamicsResults, arm: str) -> list[str]:
    """`DeLaN, ours 4 of 10`, of models with runs that had to be stopped."""
    every = [(model, form) for model in results.tracked(arm) for form in FORM_TITLES]
    counts = {key: results.stopped(arm, *key) for key in every}
    return [
        f"{model_name(model)} ({FORM_TITLES[form].lower()}) {count} of {results.count(arm, model, form)}"
        for (model, form), count in counts.items()
        if count
    ]


def _friction(results: DynamicsResults) -> dict[str, float]:
    """Median relative errors of learned coefficients; `factor` of viscous ones alone."""
    known = results.friction
    ratio = (known["value"] / known["truth"]).groupby([known["model"], known["term"]])
    median = ratio.median()
    off = (ratio.obj - 1.0).abs().groupby([known["model"], known["term"]]).median()
    return off[f"cov{COULOMB}"].to_dict() | {"factor": median["cov", "viscous"]}
