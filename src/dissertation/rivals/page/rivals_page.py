"""The page on rivals: cost over the number of demonstrations, choices with their budgets, verdicts."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from dissertation.evidence.claims import judge, read_claims
from dissertation.evidence.judged_page import JudgedDocument
from dissertation.evidence.results import Results
from dissertation.evidence.studies import Study, rests_on
from dissertation.rivals.choice import TrialParameters, drawn_methods, trial_costs
from dissertation.rivals.networks import DEPARTURES
from dissertation.rivals.page.findings import DEMONSTRATED, LOOKS, STUDY, UNSEEN, by_level, findings
from dissertation.rivals.protocol import MODELS, NOMINAL, ComparisonParameters
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import geometric_mean
from structlearn.reporting.figure_style import legend, panel, styled
from structlearn.reporting.findings import Findings

TIMES = Path("reports/benchmarks/rivals.csv")
"""Of `benchmarks/rivals.py`, shown if it is there: seconds differ from run to run, so no stage makes it."""


def page(
    study: Study, choices: Study, parameters: ComparisonParameters, budget: TrialParameters
) -> tuple[JudgedDocument, dict[str, list[Figure]], dict[str, Table], Findings]:
    """Page, figures, tables and findings from both studies."""
    results = Results(study.results, "person")
    find = findings(results)
    departures = [(name, *map(str, both)) for name, both in DEPARTURES.items()]
    tables = {
        "rival_choices": Table(trials_table(choices.results, budget)),
        "rival_departures": Table(pd.DataFrame(departures, columns=["parameter", "published", "here"])),
    }
    if TIMES.exists():
        tables["rival_times"] = Table(pd.read_csv(TIMES), {"training_s": ".1f", "decision_ms": ".3f"})
    facts = {"params": parameters, "budget": budget, "found": find, "tables": tables}
    claims = read_claims(Path(__file__).with_name("rivals_claims.yaml"))
    document = JudgedDocument(
        template="rivals.html.jinja",
        package=__package__,
        facts=facts,
        tables=tables,
        recordings="../rerun/rivals",
        judged=judge(claims, find, facts),
        parameters={"rivals": parameters, "rival_trials": budget},
        simulated=True,
        basis=rests_on(STUDY, study),
        command="python stages/rivals/report.py",
    )
    return document, {"rival_costs": cost_figures(results)}, tables, find


@styled
def cost_figures(results: Results) -> list[Figure]:
    """Cost over demonstrations per tilt, geometric mean over people with its 95 % interval."""
    figures = []
    for title, settings in (("demonstrated tilts", DEMONSTRATED), ("tilts nobody demonstrated", UNSEEN)):
        costs, (figure, axes) = by_level(results, settings=settings), panel(title, height=3.8)
        for place, model in enumerate(MODELS):
            found = [geometric_mean(one.dropna().to_numpy()) for _, one in costs[model].items()]
            value, low, high = np.array([(one.value, one.low, one.high) for one in found]).T
            look: dict[str, Any] = {"color": LOOKS[model].colour, "label": LOOKS[model].name}
            if model == NOMINAL:
                axes.axhline(value[0], linestyle="--", linewidth=1.2, **look)
                continue
            x = np.array(costs[model].columns, float) * 1.03 ** (place - 2)  # side by side
            bars = np.nan_to_num([value - low, high - value], posinf=0.0)
            axes.errorbar(x, value, bars, marker="o", markersize=3.5, elinewidth=1.4, linewidth=1.0, **look)
        axes.set_xscale("log", base=2)
        ticks = [one for one in costs.columns.unique("level") if one]
        axes.set_xticks(ticks, [f"{one:g}" for one in ticks])
        axes.set(xlabel="demonstrations per tilt", ylabel="cost (rad)", ylim=(0.0, None))
        figures.append(legend(figure, columns=1))
    return figures


def trials_table(results: pd.DataFrame, budget: TrialParameters) -> pd.DataFrame:
    """All trials: geometric mean of the cost over tuning people and tilts, failures, what was drawn."""
    tables = []
    for model in MODELS[1:]:
        drawn = pd.json_normalize([one.model_dump() for one in drawn_methods(model, budget)]).astype(str)
        differ = drawn.loc[:, (drawn != drawn.iloc[0]).any()]
        own = results[(results["quantity"] == "failed") & (results["model"] == model)]
        costs = trial_costs(results, model)
        columns = {
            "method": LOOKS[model].name,
            "trial": costs.index.astype(int),
            "cost_rad": costs,
            "failed": own.groupby("level")["value"].mean(),
            "drawn": [", ".join(f"{key} {its}" for key, its in row.items()) for _, row in differ.iterrows()],
            "note": np.where(costs.index == costs.idxmin(), "chosen", ""),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)
