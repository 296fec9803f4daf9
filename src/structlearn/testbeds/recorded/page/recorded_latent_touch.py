"""The part of the recorded page on latent spaces of touch: what they hold, and what carries over."""

from collections.abc import Iterable

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Picture

from structlearn.ground.artefacts import Metrics
from structlearn.palette import BLACK, BLUE, GREY, ORANGE
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import listing, rounded, with_spread
from structlearn.testbeds.recorded.protocol.latent_touch import (
    COMPONENTS,
    DIMENSIONS,
    MODELS,
    NEW_MATERIAL,
    NEW_SET,
    NEW_TRIALS,
    OWN_UNITS,
    PLAIN,
    STRUCTURED,
    LatentTouchResults,
)
from structlearn.testbeds.recorded.protocol.touch_sets import MAGNITUDES, SIMULATED, SLIDES, UNSCREWING

ASKED = (
    (SLIDES, SLIDES, NEW_TRIALS),
    (SLIDES, SLIDES, NEW_MATERIAL),
    (SLIDES, SLIDES, OWN_UNITS),
    (MAGNITUDES, SLIDES, NEW_SET),
    (SLIDES, MAGNITUDES, NEW_SET),
    (UNSCREWING, UNSCREWING, NEW_TRIALS),
    (SIMULATED, UNSCREWING, NEW_SET),
    (UNSCREWING, SIMULATED, NEW_SET),
    (SIMULATED, SIMULATED, NEW_TRIALS),
    (MAGNITUDES, MAGNITUDES, NEW_TRIALS),
)
"""What was learned from, what was asked about, and what was new in it; in the order of the page."""

COLOURS = {STRUCTURED: BLUE, PLAIN: ORANGE, COMPONENTS: GREY}

SHORT = {
    STRUCTURED: "the structured latent space",
    PLAIN: "the latent space without structure",
    COMPONENTS: "principal components",
}

ERRORS = ("reconstruction", "distances", "pressure")

PUBLISHED = 0.25
"""The dissertation's reconstruction NMSE stays below this in every split of its own recordings (II.4.2)."""


@styled
def errors_figure(results: LatentTouchResults) -> Picture:
    """Reconstruction error of every model on what is new; mean and spread over parts and seeds."""
    scores = _scores(results)
    figure = canvas(4.2)
    panel = figure.subplots()
    for offset, model in zip((-0.22, 0.0, 0.22), MODELS, strict=True):
        its = scores.xs(model, level="model")
        mean, std = its["reconstruction"], its["reconstruction_std"]
        rows = np.array([ASKED.index(key) for key in its.index]) + offset
        low = np.minimum(std, 0.9 * mean)  # a logarithmic axis has no zero
        panel.errorbar(mean, rows, xerr=[low, std], fmt="o", markersize=5, color=COLOURS[model], label=model)
    panel.axvline(PUBLISHED, color=BLACK, linestyle="--", linewidth=1.0)
    panel.axvline(1.0, color=BLACK, linewidth=1.0)
    ticks = [0.03, 0.1, 0.3, 1, 3, 10]
    panel.set(xscale="log", xlabel="NMSE of the reconstruction")
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.minorticks_off()
    panel.set_yticks(range(len(ASKED)), [_asked_name(*key) for key in ASKED])
    panel.invert_yaxis()
    legend_above(figure, panel)
    return figure


@styled
def correlations_figure(results: LatentTouchResults) -> Picture:
    """Correlation matrices of the electrodes, one panel per set."""
    names = (SLIDES, MAGNITUDES, UNSCREWING, SIMULATED)
    figure = canvas(2.9)
    panels = figure.subplots(1, len(names), sharex=True, sharey=True)
    for panel, name in zip(panels, names, strict=True):
        its = results.correlations[results.correlations["set"] == name]
        matrix = its.pivot_table(index="electrode", columns="other", values="correlation")
        edge = len(matrix) + 0.5
        image = panel.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, extent=(0.5, edge, edge, 0.5))
        panel.set(title=name.capitalize(), xlabel="electrode")
        panel.set_xticks([1, 7, 11, 19])
        panel.grid(visible=False)
    panels[0].set_ylabel("electrode")
    panels[0].set_yticks([1, 7, 11, 19])
    figure.colorbar(image, ax=list(panels), label="correlation", shrink=0.85)
    return figure


def pictures(results: LatentTouchResults) -> dict[str, Picture]:
    """Figures by name."""
    return {"latent_touch": errors_figure(results), "latent_touch_electrodes": correlations_figure(results)}


def tables(results: LatentTouchResults) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {
        "latent_touch": results.errors,
        "latent_touch_sets": results.sets,
        "latent_touch_likeness": results.likeness,
    }


def metrics(results: LatentTouchResults) -> Metrics:
    """Flat metrics: of the structured latent space, and reconstruction by the rival."""
    scores = _scores(results)["reconstruction"]
    spaces = _scores(results).xs(STRUCTURED, level="model")
    values: Metrics = {}
    for name in (SLIDES, UNSCREWING):
        own = spaces.loc[(name, name, NEW_TRIALS)]
        values[f"touch_reconstruction_nmse_{name}"] = own["reconstruction"]
        values[f"touch_mds_nmse_{name}"] = own["distances"]
        values[f"touch_pressure_nmse_{name}"] = own["pressure"]
        values[f"touch_components_nmse_{name}"] = scores[name, name, NEW_TRIALS, COMPONENTS]
    carried = {SLIDES: MAGNITUDES, UNSCREWING: SIMULATED}
    for name, source in carried.items():
        for prefix, model in (("reconstruction", STRUCTURED), ("components", COMPONENTS)):
            values[f"touch_{prefix}_nmse_simulated_to_{name}"] = scores[source, name, NEW_SET, model]
        values[f"touch_electrode_correlation_simulated_{name}"] = _likeness(results, name, source)
    values["touch_reconstruction_nmse_new_material"] = scores[SLIDES, SLIDES, NEW_MATERIAL, STRUCTURED]
    return values


def score_table(results: LatentTouchResults) -> pd.DataFrame:
    """One row per thing that was asked.

    Returns:
        `learned from`, `asked about`; reconstruction NMSE of every model, and `distances` and `pressure` of
        the structured latent space, as mean and standard deviation over parts and seeds in text.
    """
    scores = _scores(results)
    rows = []
    for key in ASKED:
        found = scores.loc[key]
        row = {"learned from": key[0], "asked about": _what(*key[1:])}
        row |= {model: _spread(found.loc[model], "reconstruction") for model in MODELS}
        row |= {name: _spread(found.loc[STRUCTURED], name) for name in ERRORS[1:]}
        rows.append(row)
    return pd.DataFrame(rows)


def section(results: LatentTouchResults, sizes: Sizes) -> Section:
    """The section of the page."""
    return Section(
        "Touch in a latent space: what carries over from simulation",
        (
            Prose(_what_was_done(results)),
            Prose(_what_the_counts_are(results)),
            Table(
                results.sets,
                "The sets. Counts: root mean square of the electrodes' standard deviations. Against: share "
                "of the changes against the pressure. Start, end: mean pressure of the trials there. "
                "Components: principal components that hold 99 % of the standardised variance. Along, "
                "across: place of the estimated contact point on the skin, from where the round tip begins, "
                "and its standard deviation.",
                formats={
                    "counts": ".1f",
                    "against": ".2f",
                    "start_counts": ".1f",
                    "end_counts": ".1f",
                    **dict.fromkeys(("along_mm", "across_mm", "along_std_mm", "across_std_mm"), ".1f"),
                },
                headings={
                    "start_counts": "start (counts)",
                    "end_counts": "end (counts)",
                    "along_mm": "along (mm)",
                    "across_mm": "across (mm)",
                    "along_std_mm": "std along (mm)",
                    "across_std_mm": "std across (mm)",
                },
                source="tables/latent_touch_sets.csv",
            ),
            Prose(_held_out(results)),
            beside(
                "latent_touch",
                sizes,
                "NMSE of the reconstructed electrodes, mean and standard deviation over parts that are left "
                "out and seeds. 1 (solid) is as good as the mean; dashed: below this the dissertation stays.",
                "Ten rows of three dots with bars on a logarithmic axis.",
            ),
            Table(
                score_table(results),
                "NMSE on what is new, mean ± standard deviation over parts and seeds: of the reconstruction "
                "by three models, of map distances against geodesics and of the pressure by the structured "
                "latent space.",
                headings={
                    **{model: f"reconstruction, {model}" for model in MODELS[:2]},
                    COMPONENTS: f"reconstruction, {COMPONENTS}",
                },
                source="tables/latent_touch.csv",
            ),
            Prose(_carried(results)),
            beside(
                "latent_touch_electrodes",
                sizes,
                "How the 19 electrodes go together: correlations over all samples of a set.",
                "Four matrices of correlations.",
            ),
            Table(
                results.likeness,
                "How alike two such matrices are: correlation of what stands beside their diagonals. A set "
                "beside itself: its materials or its logs, mean over pairs.",
                formats={"correlation": ".2f"},
                source="tables/latent_touch_likeness.csv",
            ),
            Prose(_alike(results)),
        ),
    )


def _what_was_done(results: LatentTouchResults) -> str:
    sets = results.sets.set_index("set")
    return (
        "The autoencoder of the servoing testbed, the same code, learns from recorded electrodes: "
        f"{sets.loc[SLIDES, 'trials']} slides and {sets.loc[UNSCREWING, 'trials']} logs of unscrewing, each "
        f"beside {sets.loc[SIMULATED, 'trials']} simulated demonstrations of touching a handle. It has 3 "
        "latent dimensions, with structure (a flat map of the skin and the pressure) or for the "
        "reconstruction only; the rival is 3 principal components. Whole trials are left out in turn, or one "
        "of both materials. What was learned from one set is also asked about another, each electrode "
        "standardised by the set it belongs to."
    )


def _what_the_counts_are(results: LatentTouchResults) -> str:
    slides = results.sets.set_index("set").loc[SLIDES]
    return (
        "The sets differ in what their counts mean. The slides were published as magnitudes: which way an "
        "electrode changed is lost, and the mean falls from "
        f"{slides['start_counts']:.0f} counts at the start of a slide to {slides['end_counts']:.0f} at its "
        "end, while the finger stays on the material. So the contact point that is estimated from them, "
        "and with it the map, is that of a pattern of electrodes and not of a place that is known to be "
        "touched. They are set beside the magnitudes of simulated touch; the logs of unscrewing keep the "
        "direction and are set beside simulated touch as it is."
    )


def _held_out(results: LatentTouchResults) -> str:
    scores = _scores(results)
    said, linear = [], []
    for name in (SLIDES, UNSCREWING, SIMULATED):
        found = scores.loc[(name, name, NEW_TRIALS)]["reconstruction"]
        said.append(f"{name} {_numbers(found[model] for model in MODELS)}")
        linear.append(found[COMPONENTS] <= min(found[STRUCTURED], found[PLAIN]))
    spaces = scores.xs(STRUCTURED, level="model")
    maps, pressures = (
        _numbers(spaces.loc[(name, name, NEW_TRIALS), error] for name in (SLIDES, UNSCREWING, SIMULATED))
        for error in ERRORS[1:]
    )
    count = results.sets.set_index("set")["components"]
    needed = "Only simulated touch needs a network. " if linear == [True, True, False] else ""
    simple = (
        f"99 % of the variance takes {count[SLIDES]} and {count[UNSCREWING]} principal components in the "
        f"recordings, {count[SIMULATED]} in simulated touch, which wanders over the whole skin. "
    )
    return (
        "NMSE of the reconstruction on new trials, with structure, without, and by principal components: "
        f"{'; '.join(said)}. {needed}{simple}Map distances of the structured latent space have an NMSE of "
        f"{maps} on slides, unscrewing and simulated touch, the pressure of {pressures}."
    )


def _carried(results: LatentTouchResults) -> str:
    scores = _scores(results)["reconstruction"]

    def numbers(*key: str) -> str:
        return _numbers(scores.loc[key].loc[[STRUCTURED, COMPONENTS]])

    pairs = [
        f"{source} to {target} {numbers(source, target, NEW_SET)}"
        for source, target, new in ASKED
        if new == NEW_SET
    ]
    chance = 1 - DIMENSIONS / results.correlations["electrode"].nunique()
    least = scores[scores.index.get_level_values("new") == NEW_SET]
    source, target, _, model = least.idxmin()
    share = (1 - least.min()) / (1 - scores[target, target, NEW_TRIALS, model])
    return (
        "What carries over, as NMSE of the reconstruction by the structured latent space and by principal "
        f"components: {'; '.join(pairs)}. {DIMENSIONS} directions drawn at random would leave {chance:.2f}. "
        f"Most carries over from {source} to {target}, by {SHORT[model]}: {100 * share:.0f} % of the "
        "variance that the same model explains when it has learned from other trials of the set itself. From "
        "one material to the other it is "
        f"{numbers(SLIDES, SLIDES, NEW_MATERIAL)}, and {numbers(SLIDES, SLIDES, OWN_UNITS)} when each is "
        "standardised by itself."
    )


def _alike(results: LatentTouchResults) -> str:
    sets = results.sets.set_index("set")
    carried = _scores(results).xs(STRUCTURED, level="model").loc[(SIMULATED, UNSCREWING, NEW_SET)]
    verdict = (
        "A network that learned from simulated touch does not serve a real finger as it is: its latent space "
        "has to be learned from touches of that finger, over the whole skin, with the direction of every "
        "change kept."
        if carried["reconstruction"] > PUBLISHED
        else "A network that learned from simulated touch serves a real finger as it is."
    )
    return (
        "The electrodes' correlations, taken as a list of pairs, correlate by "
        f"{_likeness(results, UNSCREWING, SIMULATED):.2f} between unscrewing and simulated touch and by "
        f"{_likeness(results, SLIDES, MAGNITUDES):.2f} between slides and simulated magnitudes; between two "
        f"logs of unscrewing by {_likeness(results, UNSCREWING, UNSCREWING):.2f}, between the two materials "
        f"by {_likeness(results, SLIDES, SLIDES):.2f}. The places differ too: the logs touch at "
        f"{_place(sets.loc[UNSCREWING])} along the finger, simulated touch at {_place(sets.loc[SIMULATED])}. "
        f"{verdict}"
    )


def _place(its: pd.Series) -> str:
    return f"{with_spread(its['along_mm'], its['along_std_mm'])} mm"


def _likeness(results: LatentTouchResults, first: str, second: str) -> float:
    """NaN where a set has but one group."""
    its = results.likeness
    return float(its.loc[(its["first"] == first) & (its["second"] == second), "correlation"].mean())


def _scores(results: LatentTouchResults) -> pd.DataFrame:
    """Mean errors and their standard deviations (`..._std`), by an entry of `ASKED` and the model."""
    by = results.errors.groupby(["learned_from", "asked_about", "new", "model"])[list(ERRORS)]
    scores = by.mean().join(by.std().add_suffix("_std")).sort_index()
    return scores[[key[:3] in ASKED for key in scores.index]]


def _asked_name(learned_from: str, asked_about: str, new: str) -> str:
    return f"{learned_from} \N{RIGHTWARDS ARROW} {_what(asked_about, new)}"


def _what(asked_about: str, new: str) -> str:
    return asked_about if new == NEW_SET else new


def _spread(found: pd.Series, error: str) -> str:
    return with_spread(found[error], found[f"{error}_std"], ".2f")


def _numbers(values: Iterable[float]) -> str:
    return listing(rounded(value, ".2f") for value in values)
