"""The page on rivals: cost and hits over the number of demonstrations, trials, verdicts."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Results
from dissertation.evidence.studies import OURS, Study, rests_on
from dissertation.rivals.choice import DrawingParameters, drawn_methods, trial_costs
from dissertation.rivals.networks import DEPARTURES
from dissertation.rivals.page import findings as own
from dissertation.rivals.page.findings import AVOIDING, DEMONSTRATED, LOOKS, NEW_TILTS, by_level
from dissertation.rivals.protocol import MODELS, NOMINAL, ComparisonParameters
from dissertation.rivals.reaching.reaching_protocol import ReachingParameters, failures
from structlearn.palette import Look
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import Evidence, geometric_mean, mean
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings


class Compared(NamedTuple):
    """One comparison: its people, and the trials before it."""

    study: Study
    choices: Study
    parameters: ComparisonParameters | ReachingParameters
    budget: DrawingParameters  # of the trials
    looks: Mapping[str, Look]


def page(
    board: Compared, longer: Study, spheres: Compared
) -> tuple[JudgedDocument, dict[str, list[Figure]], dict[str, Table], Findings]:
    """Page, figures, tables and findings from all studies."""
    costs, hits = (Results(one.study.results, "person") for one in (board, spheres))
    find = own.findings(costs, Results(by_variant(longer), "person"), hits)
    departures = [(name, *map(str, both)) for name, both in DEPARTURES.items()]
    tables = {
        "rival_choices": Table(trials_table(board, trial_costs, "cost_rad")),
        "reaching_choices": Table(trials_table(spheres, failures, "failed")),
        "rival_departures": Table(pd.DataFrame(departures, columns=["parameter", "published", "here"])),
    }
    facts = {
        "board": board,
        "spheres": spheres,
        "longer_people": longer.results["person"].nunique(),
        "found": find,
        "tables": tables,
    }
    claims = read_claims(Path(__file__).with_name("rivals_claims.yaml"))
    rests = {own.STUDY: board.study, own.LONGER: longer, own.REACHING: spheres.study}
    document = JudgedDocument(
        template="rivals.html.jinja",
        package=__package__,
        facts=facts,
        tables=tables,
        judged=judge(claims, find, facts),
        parameters={
            "rivals": board.parameters,
            "rival_trials": board.budget,
            "reaching": spheres.parameters,
            "reaching_trials": spheres.budget,
        },
        simulated=True,
        basis=" ".join(rests_on(name, study) for name, study in rests.items()),
        command="python stages/rivals/report.py",
    )
    tilts = {"demonstrated tilts": DEMONSTRATED, "tilts nobody demonstrated": NEW_TILTS}
    figures = [
        level_figure(title, by_level(costs, settings=its), geometric_mean, "cost (rad)", "per tilt", LOOKS)
        for title, its in tilts.items()
    ]
    missed = level_figure("unseen spheres", own.hits(hits), mean, "spheres hit (%)", "per place", AVOIDING)
    return document, {"rival_costs": figures, "rival_hits": [missed]}, tables, find


def by_variant(study: Study) -> pd.DataFrame:
    """Results of a study with the variant as part of the model's name."""
    table, changed = study.results, study.results["model"] + ", " + study.results["variant"]
    return table.assign(model=table["model"].where(table["variant"] == OURS, changed))


@styled
def level_figure(
    title: str,
    values: pd.DataFrame,
    statistic: Callable[[np.ndarray], Evidence],
    quantity: str,
    per: str,
    looks: Mapping[str, Look],
) -> Figure:
    """A quantity over the demonstrations per setting, a line per method with its 95 % interval over people.

    `values`: a row per person, columns model and level.
    """
    figure, axes = panel(title, height=3.8)
    for place, model in enumerate(MODELS):
        found = [statistic(one.dropna().to_numpy()) for _, one in values[model].items()]
        value, low, high = np.array([(one.value, one.low, one.high) for one in found]).T
        look: dict[str, Any] = {"color": looks[model].colour, "label": looks[model].name}
        if model == NOMINAL:
            axes.axhline(value[0], linestyle="--", linewidth=1.2, **look)
            continue
        x = np.array(values[model].columns, float) * 1.03 ** (place - 2)  # side by side
        bars = np.nan_to_num([value - low, high - value], posinf=0.0)
        axes.errorbar(x, value, bars, marker="o", markersize=3.5, elinewidth=1.4, linewidth=1.0, **look)
    axes.set_xscale("log", base=2)
    ticks = [one for one in values.columns.unique("level") if one]
    axes.set_xticks(ticks, [f"{one:g}" for one in ticks])
    axes.set(xlabel=f"demonstrations {per}", ylabel=quantity, ylim=(0.0, None))
    return legend(figure, columns=1)


def trials_table(
    compared: Compared, score: Callable[[pd.DataFrame, str], pd.Series], name: str
) -> pd.DataFrame:
    """All trials by their score, of which the lowest is chosen; the share that failed, and what was drawn."""
    results, tables = compared.choices.results, []
    for model in MODELS[1:]:
        methods = drawn_methods(model, compared.budget)
        drawn = pd.json_normalize([one.model_dump() for one in methods]).astype(str)
        differ = drawn.loc[:, (drawn != drawn.iloc[0]).any()]
        scores = score(results, model)
        columns = {
            "method": compared.looks[model].name,
            "trial": scores.index.astype(int),
            name: scores,
            "failed": failures(results, model),
            "drawn": [", ".join(f"{key} {its}" for key, its in row.items()) for _, row in differ.iterrows()],
            "note": np.where(scores.index == scores.idxmin(), "chosen", ""),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)
