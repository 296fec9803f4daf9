"""Section on touch in a latent space: recorded sets, and transfer between them and simulated touch."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import mean
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import listing, rounded, with_spread
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch import touch_names as names
from structlearn.tasks.touch.touch_names import COMPONENTS, NEW_SET, NEW_TRIALS, SLIDES, SPACES, STRUCTURED

Tables = Mapping[str, pd.DataFrame]

PUBLISHED_NMSE = 0.25  # bound of the claims, drawn as a dashed line
MODELS = (STRUCTURED, names.PLAIN, COMPONENTS)
KEYS = ["learned_from", "test_run", "new", "model"]


def sections(files: TaskFiles) -> list[Section]:
    """The section on sets of touches, from the tables of `learning.learn_transfer`."""
    tables = files.tables("transfer")
    find, scores = find_transfer(tables), touch_scores(tables)
    section = Section(
        "touch",
        "Touch in a latent space",
        "transfer.html.jinja",
        "transfer_lead.html.jinja",
        facts=transfer_facts(tables, scores, find) | {"origins": files.origins()},
        find=find,
        tables={
            "touch_scores": scores_table(scores),
            "latent_touch_sets": shown(tables["sets"]),
            "latent_touch_likeness": shown(tables["likeness"]),
        },
        pictures={
            "touch": [touch_panel(scores, carried) for carried in (False, True)],
            "touch_electrodes": correlation_panels(tables["correlations"]),
        },
    )
    return [section]


def partners(tables: Tables) -> dict[str, str]:
    """Simulated partner of each recorded set that exists here."""
    there = set(tables["sets"]["set"])
    return {name: names.PARTNERS[name] for name in (SLIDES, names.UNSCREWING) if name in there}


def touch_scores(tables: Tables) -> pd.DataFrame:
    """Mean errors of latent spaces and their `..._std`, by entry of `TESTS` and `model`."""
    by = tables["errors"].groupby(KEYS)[["reconstruction", "distances", "pressure"]]
    scores = by.mean().join(by.std().add_suffix("_std")).sort_index()
    return scores[[key[:3] in names.TESTS for key in scores.index]]


def find_transfer(tables: Tables) -> Findings:
    """Findings, by the names that claims and sentences use."""
    find, sets = Findings("parts of the trials left out, or seeds"), partners(tables)
    scores = touch_scores(tables)["reconstruction"]
    for name, source in sets.items():
        find.exact(f"reconstruction_nmse_{name}", scores[name, name, NEW_TRIALS, STRUCTURED], headline=True)
        carried = scores[source, name, NEW_SET, STRUCTURED]
        find.exact(f"reconstruction_nmse_simulated_to_{name}", carried, headline=True)
    if (new := (SLIDES, SLIDES, names.NEW_MATERIAL, STRUCTURED)) in scores.index:
        find.exact("reconstruction_nmse_new_material", scores[new])
    by_question = dict(list(tables["errors"].groupby(KEYS)))

    def of(error: str, source: str, target: str, model: str = STRUCTURED) -> pd.Series:
        """By part left out, mean over seeds; by seed if nothing was left out."""
        its = by_question[source, target, NEW_TRIALS if source == target else NEW_SET, model]
        return its.groupby("part" if len(set(its["part"])) > 1 else "seed")[error].mean()

    def gain(name: str) -> pd.Series:
        """Error of principal components, which have no seeds, minus that of the latent space."""
        own, rival = of("reconstruction", name, name), of("reconstruction", name, name, COMPONENTS)
        return (rival if len(rival) == len(own) else rival.mean()) - own

    find.add("reconstruction", {name: mean(of("reconstruction", name, name)) for name in sets})
    find.add("map_distances", {name: mean(of("distances", name, name)) for name in sets})
    find.add("over_components", {name: mean(gain(name)) for name in sets})
    simulated = gain(names.SIMULATED) if names.SIMULATED in sets.values() else None
    find.mean("over_components_simulated", simulated, missing="its recorded set is missing")
    carried_over = {name: mean(of("reconstruction", source, name)) for name, source in sets.items()}
    find.add("carried_over", carried_over)
    return find


def transfer_facts(tables: Tables, every: pd.DataFrame, find: Findings) -> dict[str, object]:
    """Findings and other values for the sentences."""
    sets, scores = tables["sets"].set_index("set"), every["reconstruction"]
    new_sets = scores.xs(NEW_SET, level="new")
    origin, target, model = new_sets.idxmin()
    trials = scores.xs(NEW_TRIALS, level="new").groupby(level=1)
    linear = {name: its.droplevel([0, 1]).idxmin() == COMPONENTS for name, its in trials}
    alone = [name for name in (SLIDES, names.UNSCREWING, names.SIMULATED) if name in sets.index]
    alike = tables["likeness"].groupby(["first", "second"])["correlation"].mean()

    def touch(first: str, second: str, new: str, *models: str) -> str:
        """Reconstruction errors by some models, by default all."""
        return listing(rounded(scores[first, second, new, one], ".2f") for one in models or MODELS)

    def error(kind: str, name: str) -> str:
        """Of the structured latent space on new trials of a set."""
        return rounded(every[kind][name, name, NEW_TRIALS, STRUCTURED], ".2f")

    there = partners(tables)
    return find.numbers() | {
        "touch": touch,
        "error": error,
        "sets": sets.to_dict("index"),
        "alone": alone,
        "pairs": [pair for name, partner in there.items() for pair in ((partner, name), (name, partner))],
        "partners": there,
        "new_material": (SLIDES, SLIDES, names.NEW_MATERIAL, STRUCTURED) in scores.index,
        "compared": (STRUCTURED, COMPONENTS),
        "only_simulated_needs_network": [linear[name] for name in alone] == [True, True, False],
        "chance": 1 - 3 / tables["correlations"]["electrode"].nunique(),
        "carried_from": origin,
        "carried_to": target,
        "carried_by": SPACES[model].name,
        "carried_percent": 100 * (1 - new_sets.min()) / (1 - scores[target, target, NEW_TRIALS, model]),
        "likeness": lambda first, second: alike.get((first, second)),
    }


def scores_table(scores: pd.DataFrame) -> Table:
    """Mean and std over parts and seeds, as text."""

    def spread(key: tuple[str, ...], error: str) -> str:
        return with_spread(scores.loc[key, error], scores.loc[key, f"{error}_std"], ".2f")

    columns = [(f"reconstruction, {SPACES[model].name}", model, "reconstruction") for model in MODELS]
    columns += [(f"{error}, structured", STRUCTURED, error) for error in ("distances", "pressure")]
    rows = [
        {"learned from": key[0], "tested on": key[1] if key[2] == NEW_SET else key[2]}
        | {heading: spread((*key, model), error) for heading, model, error in columns}
        for key in names.TESTS
        if (*key, STRUCTURED) in scores.index
    ]
    return Table(pd.DataFrame(rows))


@styled
def touch_panel(scores: pd.DataFrame, carried: bool) -> Figure:
    """Reconstruction error of every model; mean and std over parts left out and seeds."""
    title = "Learned from another set" if carried else "Learned from the same set"
    figure, axes = panel(title, 3.9, xscale="log", xlim=(0.03, 8), xlabel="NMSE of the reconstruction")
    there = set(scores.index.droplevel("model"))
    tests = [key for key in names.TESTS if (key[2] == NEW_SET) == carried and key in there]
    for offset, model in enumerate(MODELS, -1):
        its, look = scores.xs(model, level="model").loc[tests], SPACES[model]
        middle, std = its["reconstruction"], its["reconstruction_std"]
        bars = [np.minimum(std, 0.9 * middle), std]  # a logarithmic axis has no zero
        places = np.arange(len(tests)) + 0.22 * offset
        axes.errorbar(middle, places, xerr=bars, fmt="o", markersize=5, color=look.colour, label=look.name)
    axes.axvline(PUBLISHED_NMSE, color=BLACK, linestyle="--", linewidth=1.0)
    axes.axvline(1.0, color=BLACK, linewidth=1.0)
    axes.set_xticks([0.03, 0.1, 0.3, 1, 3], ["0.03", "0.1", "0.3", "1", "3"])
    axes.minorticks_off()
    pairs = [(first, second if carried else new.replace(", ", ",\n")) for first, second, new in tests]
    axes.set_yticks(range(len(tests)), [f"{first}\n\N{RIGHTWARDS ARROW} {what}" for first, what in pairs])
    axes.invert_yaxis()
    return legend(figure, 1)


@styled
def correlation_panels(correlations: pd.DataFrame) -> list[Figure]:
    """Correlation matrices of the electrodes, one panel per set."""
    figures = []
    for name, its in correlations.groupby("set", sort=False):
        ticks = [1, 7, 11, 19]
        labels = {"xlabel": "electrode", "ylabel": "electrode", "xticks": ticks, "yticks": ticks}
        figure, axes = panel(name.capitalize(), 3.4, **labels)
        matrix = its.pivot_table(index="electrode", columns="other", values="correlation")
        edge = len(matrix) + 0.5
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, extent=(0.5, edge, edge, 0.5))
        axes.grid(visible=False)
        figure.colorbar(image, ax=axes, label="correlation", shrink=0.85)
        figures.append(figure)
    return figures
