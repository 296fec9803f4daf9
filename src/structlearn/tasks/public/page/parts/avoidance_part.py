"""Obstacle avoidance: representations of the coupling term on samples left out."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.core.metrics import mean_interval
from structlearn.palette import BLACK, BLUE, GREY, ORANGE
from structlearn.reporting.claims import Evidence, Found, difference
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import rounded, with_interval
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

AIMED_NMSE = dict(zip(AXES, (0.25, 0.27, 0.42), strict=True))
"""Bounds of the claims by axis, drawn as dashed lines."""


def by_axis(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """A column of a table of avoidance by `representation` and `inputs`, with a local axis per column."""
    keys = ["representation", "inputs"]
    return table.pivot_table(index=keys, columns="axis", values=column, sort=False)[AXES]


def best_representation(results: RecordedResults) -> tuple[str, str]:
    """Representation and what it sees of the smallest error on samples left out, averaged over the axes."""
    return by_axis(results["avoidance_scores"], "nmse").mean(axis=1).idxmin()


def metrics(results: RecordedResults) -> Metrics:
    """Of the best representation, and what the phase is worth to the ensemble."""
    worth = results["avoidance_phase"]
    best = by_axis(results["avoidance_scores"], "nmse").loc[best_representation(results)]
    gain, half = (by_axis(worth, column).loc["ensemble", "phase"] for column in ("gain", "half_width"))
    values: Metrics = {f"obstacle_nmse_{axis}": best[axis] for axis in AXES}
    for axis in AXES:
        values[f"obstacle_phase_gain_{axis}"] = gain[axis]
        values[f"obstacle_phase_gain_{axis}_half_width"] = half[axis]
    return values


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    folds = results["avoidance_folds"].set_index(["representation", "inputs", "axis"])["nmse"].sort_index()

    def gains(first: tuple[str, str], second: tuple[str, str]) -> dict[str, Evidence]:
        return {f"along {axis}": difference(folds[(*first, axis)], folds[(*second, axis)]) for axis in AXES}

    best = best_representation(results)
    pooled = by_axis(results["avoidance_scores"], "nmse").loc[best]
    halves = {axis: mean_interval(folds[(*best, axis)].to_numpy())[1] for axis in AXES}
    count = results["avoidance_folds"]["fold"].nunique()
    return {
        "network_over_features": gains(("human_inspired", "features"), ("network_validation", "features")),
        "phase_to_network": gains(("network", "features"), ("network", "phase")),
        "modulation": gains(("network", "phase"), ("pmnn", "phase")),
        "phase_to_ensemble": gains(("ensemble", "features"), ("ensemble", "phase")),
        "best_representation": {
            f"along {axis}": Evidence(
                pooled[axis], pooled[axis] - halves[axis], pooled[axis] + halves[axis], count
            )
            for axis in AXES
        },
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    scores, gains = (
        by_axis(results[f"avoidance_{table}"], column)
        for table, column in (("scores", "nmse"), ("phase", "gain"))
    )
    name, inputs = best_representation(results)
    return {
        "representation_count": len(scores),
        "sample_count": int(results["avoidance_folds"].drop_duplicates("fold")["samples"].sum()),
        "block_count": results["avoidance_folds"]["fold"].nunique(),
        "best_name": public_names.REPRESENTATIONS[name],
        "best_sees": public_names.INPUTS[inputs].name,
        "avoidance_nmse": {
            name: listed(scores.loc[name, "features"])
            for name in public_names.REPRESENTATIONS
            if name != "pmnn"
        },
        "best_nmse": listed(scores.loc[name, inputs]),
        "velocity_gain": listed(gains.loc["ensemble", "phase_velocity"]),
        "linear_gain": listed(gains.loc["ridge", "phase"]),
    }


def listed(values: np.ndarray) -> str:
    """`0.18, 0.24, 0.36`: along x, y and z."""
    return ", ".join(rounded(value, ".2f") for value in values)


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    held_out, train = (by_axis(results["avoidance_scores"], column) for column in ("nmse", "train"))
    wide = held_out.join(train.add_suffix(", learned from"))
    gains, halves = (by_axis(results["avoidance_phase"], column) for column in ("gain", "half_width"))
    worth = pd.DataFrame(
        {
            axis: [with_interval(*pair, ".3f") for pair in zip(gains[axis], halves[axis], strict=True)]
            for axis in AXES
        },
        gains.index,
    )
    best = frozenset({held_out.index.get_loc(best_representation(results))})
    return {
        "avoidance_models": shown(_named(wide), best, **dict.fromkeys(wide, ".2f")),
        "avoidance_gains": shown(_named(worth.loc[[key for key in held_out.index if key in worth.index]])),
    }


def _named(wide: pd.DataFrame) -> pd.DataFrame:
    """Rows by representation and inputs, with names for people."""
    models = [public_names.REPRESENTATIONS[name] for name, _ in wide.index]
    sees = [public_names.INPUTS[inputs].name for _, inputs in wide.index]
    return pd.concat([pd.DataFrame({"model": models, "sees": sees}), wide.reset_index(drop=True)], axis=1)


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    return {
        "avoidance": [representations_panel(results, AXES), phase_panel(results)],
        "avoidance_axes": [representations_panel(results, [axis]) for axis in AXES],
    }


@styled
def representations_panel(results: RecordedResults, columns: Sequence[str]) -> Figure:
    """Error averaged over local axes, with its interval over the blocks; hollow: samples learned from."""
    title = "Averaged over three local axes" if len(columns) > 1 else f"Local {columns[0]}"
    figure, axes = panel(title, 3.4, xlabel="NMSE")
    errors, train = (
        by_axis(results["avoidance_scores"], name)[columns].mean(axis=1) for name in ("nmse", "train")
    )
    folds = results["avoidance_folds"].query("axis in @columns")
    by_fold = folds.groupby(["representation", "inputs", "fold"])["nmse"].mean()
    rows = list(public_names.REPRESENTATIONS)
    for offset, (inputs, look) in zip((-0.2, 0.0, 0.2), public_names.INPUTS.items(), strict=True):
        style: dict[str, Any] = {"color": look.colour, "marker": "o", "markersize": 5, "linestyle": ""}
        for name, _ in (key for key in errors.index if key[1] == inputs):
            place, half = rows.index(name) + offset, mean_interval(by_fold[name, inputs].to_numpy())[1]
            axes.errorbar(errors[name, inputs], place, xerr=half, **style)
            axes.plot(train[name, inputs], place, **style, fillstyle="none")
        axes.plot([], [], label=look.name, **style)
    if len(columns) == 1:
        axes.axvline(AIMED_NMSE[columns[0]], color=BLACK, linestyle="--", linewidth=1.0)
    axes.set_yticks(
        range(len(rows)), [label.replace(" (", "\n(") for label in public_names.REPRESENTATIONS.values()]
    )
    axes.set_xlim(left=0.0)
    axes.invert_yaxis()
    return legend(figure)


@styled
def phase_panel(results: RecordedResults) -> Figure:
    """What phase and its velocity take off the error, with the interval over the blocks."""
    figure, axes = panel("What the phase is worth", 3.4, ylabel="NMSE less with phase and its velocity")
    worth = results["avoidance_phase"].query("inputs == 'phase'").set_index(["representation", "axis"])
    for offset, (name, colour) in enumerate((("ridge", GREY), ("network", ORANGE), ("ensemble", BLUE)), -1):
        its, places = worth.loc[name].loc[AXES], np.arange(3) + 0.18 * offset
        label = public_names.REPRESENTATIONS[name]
        axes.errorbar(places, its["gain"], its["half_width"], fmt="o", color=colour, label=label)
    axes.axhline(0.0, color=BLACK, linewidth=1.0)
    axes.set_xticks(range(3), [f"local {axis}" for axis in AXES])
    axes.grid(axis="x", visible=False)
    return legend(figure)


PART = Part(
    name="avoidance",
    heading="Obstacle avoidance",
    page="avoidance",
    needs=("avoidance_folds", "avoidance_phase", "avoidance_scores"),
    parameters=("recorded_avoidance",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
