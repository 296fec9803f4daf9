"""Touch in a latent space: recorded sets, and what carries over between them and simulated touch."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK
from structlearn.reporting.claims import mean, unknown
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing, rounded, with_spread
from structlearn.tasks.section import Section
from structlearn.tasks.shown_tables import shown
from structlearn.tasks.touch.touch_names import (
    ASKED,
    COMPONENTS,
    NEW_MATERIAL,
    NEW_SET,
    NEW_TRIALS,
    PARTNERS,
    PLAIN,
    SIMULATED,
    SLIDES,
    SPACES,
    STRUCTURED,
    UNSCREWING,
)

Tables = Mapping[str, pd.DataFrame]

TEXT_NMSE = 0.25
"""Bound of the claims, drawn as a dashed line."""

MODELS = (STRUCTURED, PLAIN, COMPONENTS)


def partners(tables: Tables) -> dict[str, str]:
    """Recorded sets that are there, and the simulated ones that they are compared with."""
    there = set(tables["sets"]["set"])
    return {name: PARTNERS[name] for name in (SLIDES, UNSCREWING) if name in there}


def touch_scores(tables: Tables) -> pd.DataFrame:
    """Mean errors of latent spaces and their `..._std`, by an entry of `ASKED` and `model`."""
    errors = ["reconstruction", "distances", "pressure"]
    by = tables["errors"].groupby(["learned_from", "asked_about", "new", "model"])[errors]
    scores = by.mean().join(by.std().add_suffix("_std")).sort_index()
    return scores[[key[:3] in ASKED for key in scores.index]]


def likeness(tables: Tables, first: str, second: str) -> float | None:
    """How alike the electrodes of two sets go together; None where a set has but one group."""
    its = tables["likeness"]
    found = its.loc[(its["first"] == first) & (its["second"] == second), "correlation"]
    return float(found.mean()) if len(found) else None


def section(tables: Tables) -> Section:
    """Of tables by name."""
    find = find_transfer(tables)
    return Section(
        "touch",
        "Touch in a latent space",
        "transfer.html.jinja",
        "transfer_lead.html.jinja",
        facts=transfer_facts(tables, find),
        find=find,
        tables=transfer_tables(tables),
        pictures=transfer_pictures(tables),
    )


def find_transfer(tables: Tables) -> Findings:
    """What was found, by the names that claims and sentences use."""
    find, sets = Findings("parts of the trials left out, or seeds"), partners(tables)
    every = touch_scores(tables)
    spaces, scores = every.xs(STRUCTURED, level="model"), every["reconstruction"]
    for name, source in sets.items():
        own = spaces.loc[(name, name, NEW_TRIALS)]
        carried = scores.loc[(source, name, NEW_SET)]
        find.exact(f"reconstruction_nmse_{name}", own["reconstruction"], headline=True)
        find.exact(f"mds_nmse_{name}", own["distances"])
        find.exact(f"pressure_nmse_{name}", own["pressure"])
        find.exact(f"components_nmse_{name}", scores[name, name, NEW_TRIALS, COMPONENTS])
        find.exact(f"reconstruction_nmse_simulated_to_{name}", carried[STRUCTURED], headline=True)
        find.exact(f"components_nmse_simulated_to_{name}", carried[COMPONENTS])
        find.exact(f"electrode_correlation_simulated_{name}", likeness(tables, name, source))
    new = spaces["reconstruction"].get((SLIDES, SLIDES, NEW_MATERIAL))
    if new is not None:
        find.exact("reconstruction_nmse_new_material", new)
    by_question = dict(list(tables["errors"].groupby(["learned_from", "asked_about", "new", "model"])))

    def of(error: str, source: str, target: str, model: str = STRUCTURED) -> pd.Series:
        """By part that was left out, mean over seeds; by seed where nothing was left out."""
        its = by_question[source, target, NEW_TRIALS if source == target else NEW_SET, model]
        return its.groupby("part" if len(set(its["part"])) > 1 else "seed")[error].mean()

    def gain(name: str) -> pd.Series:
        """Reconstruction error of principal components, which have no seeds, minus the latent space's."""
        own, rival = of("reconstruction", name, name), of("reconstruction", name, name, COMPONENTS)
        return (rival if len(rival) == len(own) else rival.mean()) - own

    find.add("reconstruction", {name: mean(of("reconstruction", name, name)) for name in sets})
    find.add("map_distances", {name: mean(of("distances", name, name)) for name in sets})
    find.add("over_components", {name: mean(gain(name)) for name in sets})
    simulated = SIMULATED in sets.values()
    missing = unknown("its recorded set is missing")
    find.add("over_components_simulated", mean(gain(SIMULATED)) if simulated else missing)
    carried_over = {name: mean(of("reconstruction", source, name)) for name, source in sets.items()}
    find.add("carried_over", carried_over)
    return find


def transfer_facts(tables: Tables, find: Findings) -> dict[str, object]:
    """All findings, and other values for the sentences."""
    every, sets = touch_scores(tables), tables["sets"].set_index("set")
    scores = every["reconstruction"]
    new_sets = scores.xs(NEW_SET, level="new")
    origin, target, model = new_sets.idxmin()
    own = scores[target, target, NEW_TRIALS, model]
    trials = scores.xs(NEW_TRIALS, level="new").groupby(level=1)
    linear = {name: its.droplevel([0, 1]).idxmin() == COMPONENTS for name, its in trials}
    alone = [name for name in (SLIDES, UNSCREWING, SIMULATED) if name in sets.index]

    def touch(first: str, second: str, new: str, *models: str) -> str:
        """Reconstruction errors by some models, default all."""
        return listing(rounded(scores[first, second, new, one], ".2f") for one in models or MODELS)

    def error(kind: str, name: str) -> str:
        """Of the structured latent space on new trials of a set."""
        return rounded(every[kind][name, name, NEW_TRIALS, STRUCTURED], ".2f")

    return find.numbers() | {
        "touch": touch,
        "error": error,
        "sets": sets.to_dict("index"),
        "alone": alone,
        "pairs": [
            pair for name, partner in partners(tables).items() for pair in ((partner, name), (name, partner))
        ],
        "partners": partners(tables),
        "new_material": (SLIDES, SLIDES, NEW_MATERIAL, STRUCTURED) in scores.index,
        "compared": (STRUCTURED, COMPONENTS),
        "only_simulated_needs_network": [linear[name] for name in alone] == [True, True, False],
        "chance": 1 - 3 / tables["correlations"]["electrode"].nunique(),
        "carried_from": origin,
        "carried_to": target,
        "carried_by": SPACES[model].name,
        "carried_percent": 100 * (1 - new_sets.min()) / (1 - own),
        "likeness": lambda first, second: likeness(tables, first, second),
    }


def transfer_tables(tables: Tables) -> dict[str, Table]:
    """Tables keyed by name; scores as mean and std over parts and seeds, as text."""
    scores, rows = touch_scores(tables), []
    there = set(scores.index.droplevel("model"))

    def spread(found: pd.Series, error: str) -> str:
        return with_spread(found[error], found[f"{error}_std"], ".2f")

    for key in (key for key in ASKED if key in there):
        found = scores.loc[key]
        row = {"learned from": key[0], "tested on": key[1] if key[2] == NEW_SET else key[2]}
        row |= {
            f"reconstruction, {SPACES[model].name}": spread(found.loc[model], "reconstruction")
            for model in MODELS
        }
        row |= {
            f"{error}, structured": spread(found.loc[STRUCTURED], error)
            for error in ("distances", "pressure")
        }
        rows.append(row)
    return {
        "touch_scores": Table(pd.DataFrame(rows)),
        "latent_touch_sets": shown(tables["sets"]),
        "latent_touch_likeness": shown(tables["likeness"]),
    }


def transfer_pictures(tables: Tables) -> dict[str, Drawing | Sequence[Drawing]]:
    """Figures keyed by name."""
    return {
        "touch": [touch_panel(tables, carried) for carried in (False, True)],
        "touch_electrodes": correlation_panels(tables),
    }


@styled
def touch_panel(tables: Tables, carried: bool) -> Figure:
    """Reconstruction error of every model; mean and std over parts that are left out and seeds."""
    title = "Learned from another set" if carried else "Learned from the same set"
    figure, axes = panel(title, 3.9, xscale="log", xlim=(0.03, 8), xlabel="NMSE of the reconstruction")
    scores = touch_scores(tables)
    there = set(scores.index.droplevel("model"))
    asked = [key for key in ASKED if (key[2] == NEW_SET) == carried and key in there]
    for offset, model in enumerate(MODELS, -1):
        its, look = scores.xs(model, level="model").loc[asked], SPACES[model]
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
def correlation_panels(tables: Tables) -> list[Figure]:
    """Correlation matrices of the electrodes, one panel per set."""
    figures = []
    for name, its in tables["correlations"].groupby("set", sort=False):
        figure, axes = panel(name.capitalize(), 3.4, xlabel="electrode", ylabel="electrode")
        matrix = its.pivot_table(index="electrode", columns="other", values="correlation")
        edge = len(matrix) + 0.5
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, extent=(0.5, edge, edge, 0.5))
        axes.set(xticks=[1, 7, 11, 19], yticks=[1, 7, 11, 19])
        axes.grid(visible=False)
        figure.colorbar(image, ax=axes, label="correlation", shrink=0.85)
        figures.append(figure)
    return figures
