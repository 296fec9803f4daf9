"""The page on rivals: cost over the number of demonstrations, choices with their budgets, verdicts."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Results
from dissertation.evidence.studies import Study, rests_on
from dissertation.rivals import choice
from dissertation.rivals.findings import DEMONSTRATED, LOOKS, STUDY, UNSEEN, WHO, by_method, findings
from dissertation.rivals.networks import DEPARTURES
from dissertation.rivals.protocol import MODELS, NOMINAL, ComparisonParameters
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import geometric_mean
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings


def page(
    study: Study | None,
    choices: Study | None,
    parameters: ComparisonParameters,
    budget: choice.TrialParameters,
) -> tuple[JudgedDocument, dict[str, list[Figure]], dict[str, Table], Findings]:
    """Page, figures, tables and findings from both studies, as far as they were run."""
    find = findings(study)
    tables = {"rival_departures": Table(departures())}
    if choices:
        tables["rival_choices"] = Table(trials_table(choices.results, budget))
    facts = {"params": parameters, "budget": budget, "found": find, "looks": LOOKS, "run": study is not None}
    claims = read_claims(Path(__file__).with_name("rivals_claims.yaml"))
    document = JudgedDocument(
        template="rivals.html.jinja",
        package=__package__,
        facts=facts | {"choices": choices is not None},
        tables=tables,
        judged=judge(claims, find, facts),
        parameters={"rivals": parameters, "rival_trials": budget},
        simulated=True,
        basis=rests_on(STUDY, study),
        command="python stages/rivals/report.py",
    )
    drawn = {"rival_costs": cost_figures(Results(study.results, WHO))} if study else {}
    return document, drawn, tables, find


@styled
def cost_figures(results: Results) -> list[Figure]:
    """Cost over demonstrations per tilt, geometric mean over people with its 95 % interval."""
    figures = []
    for title, settings in (("demonstrated tilts", DEMONSTRATED), ("tilts nobody demonstrated", UNSEEN)):
        costs, (figure, axes) = by_method(results, settings=settings), panel(title, height=3.8)
        for place, model in enumerate(MODELS):
            own = costs[model].sort_index(axis=1, kind="stable")
            found = [geometric_mean(one.dropna().to_numpy()) for _, one in own.items()]
            value, low, high = np.array([(one.value, one.low, one.high) for one in found]).T
            look: dict[str, Any] = {"color": LOOKS[model].colour, "label": LOOKS[model].name}
            if model == NOMINAL:
                axes.axhline(value[0], linestyle="--", linewidth=1.2, **look)
                continue
            x = np.array(own.columns, float) * 1.03 ** (place - 2)  # side by side
            bars = np.nan_to_num([value - low, high - value], posinf=0.0)
            axes.errorbar(x, value, bars, marker="o", markersize=3.5, elinewidth=1.4, linewidth=1.0, **look)
        axes.set_xscale("log", base=2)
        ticks = [one for one in costs.columns.unique("level") if one]
        axes.set_xticks(ticks, [f"{one:g}" for one in ticks])
        axes.set(xlabel="demonstrations per tilt", ylabel="cost (rad)", ylim=(0.0, None))
        figures.append(legend(figure, columns=1))
    return figures


def departures() -> pd.DataFrame:
    """Where our transformer differs from the published one."""
    rows = [(name, str(published), str(here)) for name, (published, here) in DEPARTURES.items()]
    return pd.DataFrame(rows, columns=["parameter", "published", "here"])


def trials_table(results: pd.DataFrame, budget: choice.TrialParameters) -> pd.DataFrame:
    """All trials: geometric mean of the cost over tuning people and tilts, failures, what was drawn."""
    rows = []
    for model in MODELS[1:]:
        costs, options = choice.trial_costs(results, model), getattr(budget, model)
        own = results[(results["quantity"] == "trial_failed") & (results["model"] == model)]
        failed = own.groupby("level")["value"].mean()
        for place, trial in enumerate(choice.trials(model, budget)):
            drawn = ", ".join(f"{key} {its}" for key, its in drawn_values(trial.model_dump(), options))
            note = "chosen" if place == costs.idxmin() else ""
            rows.append((LOOKS[model].name, place, costs[place], failed[place], drawn, note))
    return pd.DataFrame(rows, columns=["method", "trial", "cost_rad", "failed", "drawn", "note"])


def drawn_values(values: Mapping[str, Any], options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Parameters of a trial that had several options."""
    for key, its in options.items():
        if isinstance(its, Mapping):
            yield from drawn_values(values[key], its)
        elif len(its) > 1:
            yield key, values[key]
