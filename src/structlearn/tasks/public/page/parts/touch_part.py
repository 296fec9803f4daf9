"""Touch in a latent space: recorded sets, and what carries over between them and simulated touch."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.palette import BLACK
from structlearn.reporting.claims import Found, mean, unknown
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import listing, rounded, with_spread
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

TEXT_NMSE = 0.25
"""Bound of the claims, drawn as a dashed line."""

COMPONENTS = "3 principal components"

PARTNERS = {"slides": "simulated, magnitudes", "unscrewing": "simulated"}
"""Recorded sets, one of which may be missing, and the simulated ones that they are set beside."""


def partners(results: RecordedResults) -> dict[str, str]:
    """Those of `PARTNERS` that are there."""
    there = set(results["touch_sets"]["set"])
    return {name: partner for name, partner in PARTNERS.items() if name in there}


def touch_scores(results: RecordedResults) -> pd.DataFrame:
    """Mean errors of latent spaces and their `..._std`, by an entry of `TOUCH_ASKED` and `model`."""
    errors = ["reconstruction", "distances", "pressure"]
    by = results["touch_errors"].groupby(["learned_from", "asked_about", "new", "model"])[errors]
    scores = by.mean().join(by.std().add_suffix("_std")).sort_index()
    return scores[[key[:3] in public_names.TOUCH_ASKED for key in scores.index]]


def likeness(results: RecordedResults, first: str, second: str) -> float | None:
    """How alike the electrodes of two sets go together; None where a set has but one group."""
    its = results["touch_likeness"]
    found = its.loc[(its["first"] == first) & (its["second"] == second), "correlation"]
    return float(found.mean()) if len(found) else None


def metrics(results: RecordedResults) -> Metrics:
    """Of the structured latent space, and reconstruction by its rival."""
    every = touch_scores(results)
    spaces, scores = every.xs("structured", level="model"), every["reconstruction"]
    values: Metrics = {}
    for name, source in partners(results).items():
        own = spaces.loc[(name, name, "new trials")]
        carried = scores.loc[(source, name, "new set")]
        values |= {
            f"touch_reconstruction_nmse_{name}": own["reconstruction"],
            f"touch_mds_nmse_{name}": own["distances"],
            f"touch_pressure_nmse_{name}": own["pressure"],
            f"touch_components_nmse_{name}": scores[name, name, "new trials", COMPONENTS],
            f"touch_reconstruction_nmse_simulated_to_{name}": carried["structured"],
            f"touch_components_nmse_simulated_to_{name}": carried[COMPONENTS],
            f"touch_electrode_correlation_simulated_{name}": likeness(results, name, source),
        }
    new = spaces["reconstruction"].get(("slides", "slides", "new material"))
    return values if new is None else values | {"touch_reconstruction_nmse_new_material": new}


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    keys = ["learned_from", "asked_about", "new", "model"]
    by_question = dict(list(results["touch_errors"].groupby(keys)))

    def of(error: str, source: str, target: str, model: str = "structured") -> pd.Series:
        """By part that was left out, mean over seeds; by seed where nothing was left out."""
        its = by_question[source, target, "new trials" if source == target else "new set", model]
        return its.groupby("part" if len(set(its["part"])) > 1 else "seed")[error].mean()

    def gain(name: str) -> pd.Series:
        """Reconstruction error of principal components, which have no seeds, minus the latent space's."""
        own = of("reconstruction", name, name)
        rival = of("reconstruction", name, name, COMPONENTS)
        return (rival if len(rival) == len(own) else rival.mean()) - own

    sets = partners(results)
    return {
        "reconstruction": {name: mean(of("reconstruction", name, name)) for name in sets},
        "map_distances": {name: mean(of("distances", name, name)) for name in sets},
        "over_components": {name: mean(gain(name)) for name in sets},
        "over_components_simulated": mean(gain("simulated"))
        if "simulated" in sets.values()
        else unknown("its recorded set is missing"),
        "carried_over": {
            target: mean(of("reconstruction", source, target)) for target, source in sets.items()
        },
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    scores, sets = touch_scores(results)["reconstruction"], results["touch_sets"].set_index("set")
    new_sets = scores.xs("new set", level="new")
    origin, target, model = new_sets.idxmin()
    own = scores[target, target, "new trials", model]
    trials = scores.xs("new trials", level="new").groupby(level=1)
    linear = {name: its.droplevel([0, 1]).idxmin() == COMPONENTS for name, its in trials}
    alone = [name for name in ("slides", "unscrewing", "simulated") if name in sets.index]

    def touch(first: str, second: str, new: str, *models: str) -> str:
        """Reconstruction errors by some models, default all."""
        return listing(
            rounded(scores[first, second, new, one], ".2f") for one in models or public_names.TOUCH_MODELS
        )

    def touch_error(error: str, name: str) -> str:
        """Of the structured latent space on new trials of a set."""
        its = touch_scores(results)[error]
        return rounded(its[name, name, "new trials", "structured"], ".2f")

    return {
        "touch": touch,
        "touch_error": touch_error,
        "touch_sets": sets.to_dict("index"),
        "touch_alone": alone,
        "touch_pairs": [
            pair for name, partner in partners(results).items() for pair in ((partner, name), (name, partner))
        ],
        "touch_partners": partners(results),
        "new_material": ("slides", "slides", "new material", "structured") in scores.index,
        "pairs": ("structured", COMPONENTS),
        "only_simulated_needs_network": [linear[name] for name in alone] == [True, True, False],
        "chance": 1 - 3 / results["touch_correlations"]["electrode"].nunique(),
        "carried_from": origin,
        "carried_to": target,
        "carried_by": public_names.TOUCH_MODELS[model].name,
        "carried_percent": 100 * (1 - new_sets.min()) / (1 - own),
        "likeness": lambda first, second: likeness(results, first, second),
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    return {
        "touch_scores": Table(_scores_in_words(results)),
        "latent_touch_sets": shown(results["touch_sets"]),
        "latent_touch_likeness": shown(results["touch_likeness"]),
    }


def _scores_in_words(results: RecordedResults) -> pd.DataFrame:
    """Mean and std over parts and seeds, as text, by what was asked."""
    scores, rows = touch_scores(results), []
    there = set(scores.index.droplevel("model"))
    for key in (key for key in public_names.TOUCH_ASKED if key in there):
        found = scores.loc[key]
        row = {"learned from": key[0], "asked about": key[1] if key[2] == "new set" else key[2]}
        for model, look in public_names.TOUCH_MODELS.items():
            row[f"reconstruction, {look.name}"] = _spread(found.loc[model], "reconstruction")
        row |= {
            f"{error}, structured": _spread(found.loc["structured"], error)
            for error in ("distances", "pressure")
        }
        rows.append(row)
    return pd.DataFrame(rows)


def _spread(found: pd.Series, error: str) -> str:
    return with_spread(found[error], found[f"{error}_std"], ".2f")


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    return {
        "touch": [touch_panel(results, carried) for carried in (False, True)],
        "touch_electrodes": correlation_panels(results),
    }


@styled
def touch_panel(results: RecordedResults, carried: bool) -> Figure:
    """Reconstruction error of every model; mean and std over parts that are left out and seeds."""
    title = "Learned from another set" if carried else "Learned from the same set"
    figure, axes = panel(title, 3.9, xscale="log", xlim=(0.03, 8), xlabel="NMSE of the reconstruction")
    scores = touch_scores(results)
    there = set(scores.index.droplevel("model"))
    asked = [key for key in public_names.TOUCH_ASKED if (key[2] == "new set") == carried and key in there]
    for offset, (model, look) in enumerate(public_names.TOUCH_MODELS.items(), -1):
        its = scores.xs(model, level="model").loc[asked]
        middle, std = its["reconstruction"], its["reconstruction_std"]
        bars = [np.minimum(std, 0.9 * middle), std]  # a logarithmic axis has no zero
        places = np.arange(len(asked)) + 0.22 * offset
        axes.errorbar(middle, places, xerr=bars, fmt="o", markersize=5, color=look.colour, label=look.name)
    axes.axvline(TEXT_NMSE, color=BLACK, linestyle="--", linewidth=1.0)
    axes.axvline(1.0, color=BLACK, linewidth=1.0)
    axes.set_xticks([0.03, 0.1, 0.3, 1, 3], ["0.03", "0.1", "0.3", "1", "3"])
    axes.minorticks_off()
    pairs = [(first, second if carried else new.replace(", ", ",\n")) for first, second, new in asked]
    axes.set_yticks(range(len(asked)), [f"{first}\n\N{RIGHTWARDS ARROW} {what}" for first, what in pairs])
    axes.invert_yaxis()
    return legend(figure, 1)


@styled
def correlation_panels(results: RecordedResults) -> list[Figure]:
    """Correlation matrices of the electrodes, one panel per set."""
    figures = []
    for name, its in results["touch_correlations"].groupby("set", sort=False):
        figure, axes = panel(name.capitalize(), 3.4, xlabel="electrode", ylabel="electrode")
        matrix = its.pivot_table(index="electrode", columns="other", values="correlation")
        edge = len(matrix) + 0.5
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, extent=(0.5, edge, edge, 0.5))
        axes.set(xticks=[1, 7, 11, 19], yticks=[1, 7, 11, 19])
        axes.grid(visible=False)
        figure.colorbar(image, ax=axes, label="correlation", shrink=0.85)
        figures.append(figure)
    return figures


PART = Part(
    name="touch",
    heading="Touch in a latent space",
    page="touch",
    needs=("touch_correlations", "touch_errors", "touch_likeness", "touch_sets"),
    parameters=("recorded_latent_touch",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
