"""Page section on representations of the coupling term: held-out errors, and the gain from the phase."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.metrics import mean_interval
from structlearn.palette import BLACK, BLUE, GREY, OCHRE, Look
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence, difference
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import rounded, with_interval
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

AXES = ["x", "y", "z"]

# the published network stops training by validation samples
REPRESENTATIONS = {
    "human_inspired": "human-inspired (Rai et al.)",
    "network_validation": "network, as published",
    "ridge": "ridge regression",
    "network": "network",
    "ensemble": "ensemble of networks",
    "pmnn": "phase-modulated network",
}
INPUTS = {
    "features": Look("features", GREY),
    "phase_velocity": Look("features, phase velocity", OCHRE),
    "phase": Look("features, phase and its velocity", BLUE),
}

Tables = Mapping[str, pd.DataFrame]  # of `learning.representation_scores`
KEYS = ["representation", "inputs"]


def by_axis(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """Table of a column by `representation` and `inputs`, with one column per local axis."""
    return table.pivot_table(index=KEYS, columns="axis", values=column, sort=False)[AXES]


def best_representation(found: Tables) -> tuple[str, str]:
    """Representation and inputs with the smallest held-out error, averaged over axes."""
    return by_axis(found["scores"], "nmse").mean(axis=1).idxmin()


def listed(values: Any) -> str:
    """Values along x, y and z as text, e.g. `0.18, 0.24, 0.36`."""
    return ", ".join(rounded(value, ".2f") for value in values)


def sections(files: TaskFiles) -> list[Section]:
    """The section on representations of the coupling term."""
    found = files.tables("coupling")
    section = Section(
        "representations",
        "Representations of the coupling term",
        "representations.html.jinja",
        lead="representations_lead.html.jinja",
        facts=representation_facts(found),
        find=representation_findings(found),
        tables=representation_tables(found),
        pictures={"representations": [errors_panel(found), phase_panel(found)]},
    )
    return [section]


def representation_findings(found: Tables) -> Findings:
    """Findings by local axis; intervals are over the blocks left out."""
    folds = found["folds"].set_index([*KEYS, "axis"])["nmse"].sort_index(kind="stable")
    best = best_representation(found)
    pooled = by_axis(found["scores"], "nmse").loc[best]
    blocks = found["folds"]["fold"].nunique()
    find = Findings(f"samples in {blocks} blocks left out in turn")
    for name, first, second in (
        ("network_over_features", ("human_inspired", "features"), ("network_validation", "features")),
        ("phase_to_network", ("network", "features"), ("network", "phase")),
        ("modulation", ("network", "phase"), ("pmnn", "phase")),
        ("phase_to_ensemble", ("ensemble", "features"), ("ensemble", "phase")),
    ):
        pairs = {f"along {axis}": (folds[(*first, axis)], folds[(*second, axis)]) for axis in AXES}
        find.add(name, {case: difference(*pair) for case, pair in pairs.items()})
    nmse = {}
    for axis in AXES:
        half = mean_interval(folds[(*best, axis)].to_numpy())[1]
        nmse[f"along {axis}"] = Evidence(pooled[axis], pooled[axis] - half, pooled[axis] + half, blocks)
    find.add("best_representation", nmse)
    find.exact("representation_count", len(found["scores"]) // len(AXES))
    find.add("nmse_x", nmse["along x"], headline=True)
    return find


def representation_facts(found: Tables) -> dict[str, object]:
    """Values for the sentences."""
    scores, gains = by_axis(found["scores"], "nmse"), by_axis(found["phase_worth"], "gain")
    name, inputs = best_representation(found)
    folds = found["folds"].drop_duplicates("fold")
    return {
        "samples": {"n": int(folds["samples"].sum()), "blocks": len(folds)},
        "best": {
            "name": REPRESENTATIONS[name],
            "sees": INPUTS[inputs].name,
            "nmse": listed(scores.loc[name, inputs]),
        },
        "nmse": {
            name: listed(scores.loc[name, "features"]) for name in ("network_validation", "human_inspired")
        },
        "velocity_gain": listed(gains.loc["ensemble", "phase_velocity"]),
        "linear_gain": listed(gains.loc["ridge", "phase"]),
    }


def representation_tables(found: Tables) -> dict[str, Table]:
    """Tables by name."""
    held_out, train = (by_axis(found["scores"], column) for column in ("nmse", "train"))
    wide = held_out.join(train.add_suffix(", learned from"))
    worth = found["phase_worth"]
    text = [with_interval(row.gain, row.half_width, ".3f") for row in worth.itertuples()]
    gains = worth.assign(text=text).pivot_table("text", KEYS, "axis", aggfunc="first")[AXES]
    best = frozenset({held_out.index.get_loc(best_representation(found))})
    return {
        "representations_models": Table(_named(wide), dict.fromkeys(wide, ".2f"), strong=best),
        "representations_gains": Table(_named(gains.loc[[key for key in wide.index if key in gains.index]])),
    }


def _named(wide: pd.DataFrame) -> pd.DataFrame:
    """Rows by representation and inputs, with readable names."""
    named = wide.reset_index(drop=True)
    named.insert(0, "model", [REPRESENTATIONS[name] for name, _ in wide.index])
    named.insert(1, "sees", [INPUTS[inputs].name for _, inputs in wide.index])
    return named


@styled
def errors_panel(found: Tables) -> Figure:
    """Error averaged over local axes, with its interval over the blocks; hollow: training error."""
    figure, axes = panel("Averaged over three local axes", 3.4, xlabel="NMSE")
    errors, train = (by_axis(found["scores"], name).mean(axis=1) for name in ("nmse", "train"))
    by_fold = found["folds"].groupby(["representation", "inputs", "fold"])["nmse"].mean()
    rows = list(REPRESENTATIONS)
    for offset, (inputs, look) in zip((-0.2, 0.0, 0.2), INPUTS.items(), strict=True):
        style: dict[str, Any] = {"color": look.colour, "marker": "o", "markersize": 5, "linestyle": ""}
        for name, _ in (key for key in errors.index if key[1] == inputs):
            place, half = rows.index(name) + offset, mean_interval(by_fold[name, inputs].to_numpy())[1]
            axes.errorbar(errors[name, inputs], place, xerr=half, **style)
            axes.plot(train[name, inputs], place, **style, fillstyle="none")
        axes.plot([], [], label=look.name, **style)
    axes.set_yticks(range(len(rows)), [label.replace(" (", "\n(") for label in REPRESENTATIONS.values()])
    axes.set_xlim(left=0.0)
    axes.invert_yaxis()
    return legend(figure)


@styled
def phase_panel(found: Tables) -> Figure:
    """Reduction of the error by phase and phase velocity, with the interval over the blocks."""
    figure, axes = panel("Gain by the phase and its velocity", 3.4, ylabel="reduction of the NMSE")
    worth = found["phase_worth"].query("inputs == 'phase'").set_index(["representation", "axis"])
    for offset, (name, colour) in enumerate((("ridge", GREY), ("network", OCHRE), ("ensemble", BLUE)), -1):
        its, places = worth.loc[name].loc[AXES], np.arange(3) + 0.18 * offset
        axes.errorbar(
            places, its["gain"], its["half_width"], fmt="o", color=colour, label=REPRESENTATIONS[name]
        )
    axes.axhline(0.0, color=BLACK, linewidth=1.0)
    axes.set_xticks(range(3), [f"local {axis}" for axis in AXES])
    axes.grid(axis="x", visible=False)
    return legend(figure)
