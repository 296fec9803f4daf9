"""The arm of a task: models tested on held-out motion, and whether to trust them."""

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics, read_table
from structlearn.core.block_bootstrap import percentiles
from structlearn.palette import BLACK, BLUE, GREY, ORANGE
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import interval, rounded
from structlearn.rigid_body.motion import drawn_nmse
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import MotionEntry
from structlearn.tasks.task_files import TaskFiles

BEST = ("cov", "coulomb")
"""The model that becomes a URDF."""

MODELS = {"urdf": "URDF", "least_squares": "least squares", "cov": "physically consistent"}
FRICTIONS = {
    "none": "none",
    "viscous": "viscous",
    "coulomb": "viscous, Coulomb",
    "offset": "viscous, Coulomb, offset",
}
FURTHER = {
    "gains": "Gains of the drives (N m/A): found at rest or in motion, assumed of another joint, quoted.",
    "loads": "The load by least squares: mass, and centre in the last joint's frame.",
    "bodies": "Links as written, with half a 95 % interval, beside the URDF's.",
    "choice": "What networks were chosen by: mean NMSE on the end of what was learned from.",
}
"""Tables that some tasks have, and their captions."""

DRAWN = {("urdf", "none"): GREY, ("least_squares", "coulomb"): ORANGE, BEST: BLUE}
"""Models with their friction and colour, as figures show them."""


def section(files: TaskFiles) -> Section:
    """Of a task with logs of joints."""
    parameters = files.entry(MotionEntry)
    names = ("motions", "blocks", "gravity", "base", "excitation", "traces")
    tables = {name: files.table(f"motion/{name}") for name in names}
    gravity, motions = tables["gravity"], tables["motions"]
    excitation = tables["excitation"].iloc[0]
    tested = tables["blocks"]["part"].unique()[1]
    blocks = tables["blocks"][tables["blocks"]["part"] == tested]
    errors = held_out_errors(blocks, list(gravity["name"]), parameters)
    best = of_model(errors, BEST)
    unsure = tables["base"].query("low < 0 < high")["parameter"]
    facts: dict[str, Any] = {
        "logs": len(motions),
        "learned_s": motions["learned_s"].sum(),
        "tested_s": motions["tested_s"].sum(),
        "worst": best.loc[best["nmse"].idxmax()].to_dict(),
        "urdf_worst": of_model(errors, ("urdf", "none"))["nmse"].max(),
        "condition": excitation["condition"],
        "largest_condition": parameters.largest_condition,
        "parameters": int(excitation["parameters"]),
        "unsure": len(unsure),
        "blocks": blocks["block"].nunique(),
        "block_s": parameters.block_s,
        "gravity": {word: list(its["name"]) for word, its in gravity.groupby("holds")},
        "urdf": f"{files.folder}/motion/identified.urdf",
    }
    further = {name: files.folder / f"motion/{name}.parquet" for name in FURTHER}
    shown = {f"motion_{name}": Table(read_table(path)) for name, path in further.items() if path.is_file()}
    facts["further"] = {name: FURTHER[name.removeprefix("motion_")] for name in shown}
    return Section(
        "motion",
        "The arm's dynamics",
        "motion.html.jinja",
        lead="motion_lead.html.jinja",
        facts=facts,
        metrics=motion_metrics(best, facts),
        tables=motion_tables(tables | {"errors": errors}) | shown,
        pictures={"motion": [errors_panel(errors), torque_panel(tables["traces"], facts["worst"])]},
    )


def held_out_errors(blocks: pd.DataFrame, joints: list[str], parameters: MotionEntry) -> pd.DataFrame:
    """NMSE with 95 % intervals per `model`, `friction` and `joint` by name (`place` counts from 1)."""
    tables = []
    for key in [tuple(name.split("/")) for name in blocks if "/" in name]:
        values, draws, _ = drawn_nmse(blocks, key, parameters.draws, parameters.seed)
        low, high = percentiles(draws)
        columns = {"joint": joints, "place": range(1, len(joints) + 1), "nmse": values}
        keys = {"model": key[0], "friction": key[1]}
        tables.append(pd.DataFrame(keys | columns | {"low": low, "high": high}))
    return pd.concat(tables, ignore_index=True)


def of_model(errors: pd.DataFrame, key: tuple[str, str]) -> pd.DataFrame:
    """Rows of one model."""
    return errors[(errors["model"] == key[0]) & (errors["friction"] == key[1])]


def motion_metrics(best: pd.DataFrame, facts: Mapping[str, Any]) -> Metrics:
    """Errors of the model that is written, and how much the motion excites."""
    values: Metrics = {"motion_nmse_worst": facts["worst"]["nmse"], "motion_nmse_urdf": facts["urdf_worst"]}
    if facts["condition"] < float("inf"):
        values["motion_condition"] = facts["condition"]
    for row in best.itertuples():
        values |= {f"motion_nmse_{row.joint}{end}": getattr(row, f"{name}") for end, name in ENDS.items()}
    return values


ENDS = {"": "nmse", "_low": "low", "_high": "high"}


def motion_tables(tables: dict[str, pd.DataFrame]) -> dict[str, Table]:
    """Tables keyed by name."""
    errors, gravity, base = tables["errors"], tables["gravity"], tables["base"]
    gravity = gravity.drop(columns="joint").rename(columns={"name": "joint"})
    text = [f"{rounded(row.nmse, '.2g')} {interval(row.low, row.high, '.2g')}" for row in errors.itertuples()]
    keys = ["model", "friction"]
    wide = errors.assign(text=text).pivot_table(
        index=keys, columns="joint", values="text", aggfunc="first", sort=False
    )
    seconds = dict.fromkeys(("length_s", "moving_s", "learned_s", "tested_s"), ".1f")
    spoken = {
        "length_s": "length (s)",
        "moving_s": "in motion (s)",
        "learned_s": "learned from (s)",
        "tested_s": "asked about (s)",
    }
    motions = tables["motions"]
    logs = motions.assign(moving_s=motions["end_s"] - motions["start_s"])[["log", *spoken]]
    return {
        "motion_errors": Table(
            wide[list(dict.fromkeys(errors["joint"]))].reset_index(),
            words={"model": MODELS, "friction": FRICTIONS},
            strong=frozenset(place for place, key in enumerate(wide.index) if key == BEST),
        ),
        "motion_logs": Table(logs, seconds, spoken),
        "motion_gravity": Table(
            gravity[["joint", "gravity_n_m", "torque_n_m", "share", "holds"]],
            dict.fromkeys(("gravity_n_m", "torque_n_m", "share"), ".2f"),
            {
                "gravity_n_m": "URDF's gravity, std (N m)",
                "torque_n_m": "torque, std (N m)",
                "share": "share of gravity in the torque",
                "holds": "holds gravity",
            },
        ),
        "motion_base": Table(base, dict.fromkeys(("value", "low", "high", "urdf"), ".3g"), {"urdf": "URDF"}),
    }


@styled
def errors_panel(errors: pd.DataFrame) -> Figure:
    """NMSE over the joints with intervals."""
    figure, axes = panel("Motion that was held out", 3.3, ylabel="NMSE", yscale="log")
    for place, (key, colour) in enumerate(DRAWN.items()):
        its = of_model(errors, key)
        bars = [its["nmse"] - its["low"], its["high"] - its["nmse"]]
        x = [joint + 0.12 * (place - 1) for joint in range(len(its))]
        label = MODELS[key[0]]
        axes.errorbar(x, its["nmse"], yerr=bars, fmt="o", markersize=4, color=colour, label=label)
    joints = list(dict.fromkeys(errors["joint"]))
    axes.set_xticks(range(len(joints)), joints, rotation=30, ha="right")
    axes.grid(visible=False, axis="x")
    return legend(figure, columns=3)


@styled
def torque_panel(traces: pd.DataFrame, worst: Mapping[str, Any]) -> Figure:
    """Torque of the joint that is predicted worst."""
    figure, axes = panel(
        f"Torque of {worst['joint']}", 3.3, xlabel="time of what was held out (s)", ylabel="torque (N m)"
    )
    its = traces[traces["joint"] == worst["place"]]
    axes.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for (model, friction), colour in DRAWN.items():
        column = model if friction == "none" else f"{model}_{friction}"
        axes.plot(its["time_s"], its[column], color=colour, linewidth=1.0, label=MODELS[model])
    return legend(figure, columns=4)
