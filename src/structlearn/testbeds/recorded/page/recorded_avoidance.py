"""The part of the recorded page on obstacle avoidance: every representation on samples it has not seen."""

import pandas as pd
from matplotlib.figure import Figure as Picture
from matplotlib.lines import Line2D

from structlearn.avoidance.avoidance_dataset import AXES
from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import mean_interval
from structlearn.palette import BLACK, BLUE, GREY, ORANGE
from structlearn.reporting.figures import canvas, styled
from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import listing, rounded, with_interval
from structlearn.testbeds.recorded.protocol.avoidance_representations import (
    ENSEMBLE,
    HUMAN_INSPIRED,
    NETWORK,
    PMNN,
    RIDGE,
    STOPPED,
    RecordedAvoidanceResults,
)

AIMS = {"x": 0.25, "y": 0.27, "z": 0.42}
"""Held-out NMSE that this project set out to stay below."""

NAMES = {
    HUMAN_INSPIRED: "Rai et al.",
    STOPPED: "network, stopped by validation",
    RIDGE: "ridge regression",
    NETWORK: "network",
    ENSEMBLE: "ensemble of networks",
    PMNN: "phase-modulated network",
}

INPUTS = {
    "features": ("features", GREY),
    "phase_velocity": ("features, phase velocity", ORANGE),
    "phase": ("features, phase and its velocity", BLUE),
}
"""What a representation sees, and its colour."""


@styled
def errors_figure(results: RecordedAvoidanceResults) -> Picture:
    """Held-out error of every representation per axis with its interval over folds, and training error."""
    pairs = _pairs(results)
    scores = results.scores.set_index(["representation", "inputs", "axis"])
    folds = results.folds.groupby(["representation", "inputs", "axis"])["nmse"]
    half_widths = folds.agg(lambda errors: mean_interval(errors.to_numpy())[1])
    figure = canvas(4.0)
    panels = figure.subplots(1, len(AXES), sharey=True)
    for panel, axis in zip(panels, AXES, strict=True):
        for row, (name, inputs) in enumerate(pairs):
            key, colour = (name, inputs, axis), INPUTS[inputs][1]
            error = scores.loc[key, "nmse"]
            panel.errorbar(error, row, xerr=half_widths[key], fmt="o", markersize=5, color=colour)
            panel.plot(scores.loc[key, "train"], row, "o", markersize=5, color=colour, fillstyle="none")
        panel.axvline(AIMS[axis], color=BLACK, linestyle="--", linewidth=1.0)
        panel.set(title=f"Local {axis}", xlabel="NMSE", xlim=(0.0, None))
    panels[0].set_yticks(range(len(pairs)), [NAMES[name] for name, _ in pairs])
    panels[0].invert_yaxis()
    dot = {"marker": "o", "markersize": 5, "linestyle": ""}
    handles = [Line2D([], [], color=colour, label=label, **dot) for label, colour in INPUTS.values()]
    handles += [
        Line2D([], [], color=BLACK, label="learned from", fillstyle="none", **dot),
        Line2D([], [], color=BLACK, linestyle="--", linewidth=1.0, label="aim"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


def pictures(results: RecordedAvoidanceResults) -> dict[str, Picture]:
    """Figures by name."""
    return {"avoidance": errors_figure(results)}


def tables(results: RecordedAvoidanceResults) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {"avoidance": results.scores, "avoidance_phase": results.phase_worth}


def score_table(results: RecordedAvoidanceResults) -> pd.DataFrame:
    """One row per representation and what it sees.

    Returns:
        `model`, `sees`; held-out NMSE `x`, `y`, `z`; `train_x`, `train_y`, `train_z`.
    """
    held_out, train = (_by_axis(results.scores, column) for column in ("nmse", "train"))
    names = pd.DataFrame(
        {
            "model": [NAMES[name] for name, _ in held_out.index],
            "sees": [INPUTS[inputs][0] for _, inputs in held_out.index],
        }
    )
    numbers = held_out.join(train.add_prefix("train_")).reset_index(drop=True)
    return pd.concat([names, numbers], axis=1)


def worth_table(results: RecordedAvoidanceResults) -> pd.DataFrame:
    """One row per representation and what it sees beside the features.

    Returns:
        `model`, `sees`; `x`, `y`, `z` gain in NMSE with its 95 % interval, as text.
    """
    gains, half_widths = (_by_axis(results.phase_worth, column) for column in ("gain", "half_width"))
    rows = []
    for name, inputs in (pair for pair in _pairs(results) if pair in gains.index):
        row = {"model": NAMES[name], "sees": INPUTS[inputs][0]}
        for axis in AXES:
            pair = gains.loc[(name, inputs), axis], half_widths.loc[(name, inputs), axis]
            row[axis] = with_interval(*pair, ".3f")
        rows.append(row)
    return pd.DataFrame(rows)


def best_row(results: RecordedAvoidanceResults) -> int:
    """Place in `score_table` of the representation with the smallest held-out error, meant over the axes."""
    return int(_by_axis(results.scores, "nmse").mean(axis=1).to_numpy().argmin())


def metrics(results: RecordedAvoidanceResults) -> Metrics:
    """Flat metrics: of the best representation, and what the phase is worth to the ensemble."""
    best = score_table(results).iloc[best_row(results)]
    values: Metrics = {f"obstacle_nmse_{axis}": best[axis] for axis in AXES}
    gains = _worth(results, ENSEMBLE, "phase")
    for axis in AXES:
        values[f"obstacle_phase_gain_{axis}"] = gains.loc[axis, "gain"]
        values[f"obstacle_phase_gain_{axis}_half_width"] = gains.loc[axis, "half_width"]
    return values


def section(results: RecordedAvoidanceResults, sizes: Sizes) -> Section:
    """The section of the page."""
    numbers = [*AXES, *(f"train_{axis}" for axis in AXES)]
    return Section(
        "Obstacle avoidance: what the phase is worth",
        (
            Prose(_what_was_done(results)),
            beside(
                "avoidance",
                sizes,
                "NMSE of the coupling term along three local axes. Full: samples left out, with the 95 % "
                "interval over the blocks; hollow: samples learned from; dashed: the aim.",
                "Dots for twelve models in three panels, coloured by what the model sees.",
            ),
            Table(
                score_table(results),
                "NMSE of the coupling term per local axis, on samples left out and on those learned from. "
                "Bold: best left out, meant over the axes.",
                formats=dict.fromkeys(numbers, ".2f"),
                headings={f"train_{axis}": f"{axis}, learned from" for axis in AXES},
                strong=frozenset({best_row(results)}),
                source="tables/avoidance.csv",
            ),
            Prose(_how_good(results)),
            Table(
                worth_table(results),
                "What the phase is worth: NMSE on left-out samples with the features alone minus that with "
                "what is named, block by block, and its 95 % interval. The blocks share most of the samples "
                "that are learned from, so the intervals are rather narrow.",
                source="tables/avoidance_phase.csv",
            ),
            Prose(_phase(results)),
        ),
    )


def _what_was_done(results: RecordedAvoidanceResults) -> str:
    count = results.folds["fold"].nunique()
    return (
        "823 samples of people who reach past obstacles, published with the code of the dissertation: 17 "
        "features of obstacle and movement in, the coupling term of three local axes out. The phase is found "
        f"again from the phase kernels beside them. {count} blocks of consecutive samples are left out in "
        "turn; their squared errors over the variance of all targets are the NMSE, which is 1 for the mean. "
        "The samples were drawn at random from many demonstrations and shuffled before they were published, "
        "and nothing says which belong together. So a sample that is left out has neighbours of its own "
        "demonstration among those learned from: the errors are those of new samples, not of new "
        "demonstrations, which would be larger."
    )


def _how_good(results: RecordedAvoidanceResults) -> str:
    table = score_table(results)
    best = table.iloc[best_row(results)]
    plain = table[(table["model"] == NAMES[STOPPED]) & (table["sees"] == INPUTS["features"][0])].iloc[0]
    steered = table[table["model"] == NAMES[HUMAN_INSPIRED]].iloc[0]
    aims = ", ".join(f"{aim:.2f}" for aim in AIMS.values())
    missed = [axis for axis, aim in AIMS.items() if best[axis] > aim]
    if missed:
        reached = f"The aim of {aims} is missed along {listing(missed)}."
    else:
        reached = f"The aim of {aims} is met on every axis."
    return (
        f"Left out, the {best['model']} that sees {best['sees']} is best: {_numbers(best)} along x, y and z. "
        f"{reached} The network as the dissertation trains it, which sees the features alone and stops when "
        f"validation samples say so, has {_numbers(plain)}; the hand-made features of Rai et al. have "
        f"{_numbers(steered)}."
    )


def _phase(results: RecordedAvoidanceResults) -> str:
    gains = _worth(results, ENSEMBLE, "phase")
    velocity, linear = (
        _worth(results, *key)["gain"] for key in ((ENSEMBLE, "phase_velocity"), (RIDGE, "phase"))
    )
    said = listing(
        f"{with_interval(gains.loc[axis, 'gain'], gains.loc[axis, 'half_width'], '.2f')} along {axis}"
        for axis in AXES
    )
    above = [axis for axis in AXES if gains.loc[axis, "gain"] > gains.loc[axis, "half_width"]]
    return (
        f"Phase and phase velocity take {said} off the error of the ensemble, with an interval above zero "
        f"along {listing(above, 'no axis')}; the phase velocity alone takes off {_numbers(velocity)}. A "
        f"linear model gains {_numbers(linear)}: what the phase says is not a share of the coupling term of "
        "its own, but how much the features count."
    )


def _worth(results: RecordedAvoidanceResults, name: str, inputs: str) -> pd.DataFrame:
    """`gain` and `half_width` by axis, in the order of the axes."""
    its = results.phase_worth
    its = its[(its["representation"] == name) & (its["inputs"] == inputs)]
    return its.set_index("axis").loc[list(AXES), ["gain", "half_width"]]


def _pairs(results: RecordedAvoidanceResults) -> list[tuple[str, str]]:
    """Representations with what they see, in their order."""
    return list(_by_axis(results.scores, "nmse").index)


def _by_axis(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """A column of a long table by `representation` and `inputs`, in their order, with an axis per column."""
    wide = table.pivot_table(index=["representation", "inputs"], columns="axis", values=column, sort=False)
    return wide[list(AXES)]


def _numbers(row: pd.Series) -> str:
    return ", ".join(rounded(row[axis], ".2f") for axis in AXES)
