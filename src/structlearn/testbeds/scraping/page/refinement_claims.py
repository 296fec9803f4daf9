"""The dissertation's statements on reinforcement learning, beside what is found here (IV.9.4)."""

from structlearn.ground.metrics import BETTER, WORSE
from structlearn.reporting.prose import interval, listing, rounded
from structlearn.testbeds.scraping.page.board_prose import degrees
from structlearn.testbeds.scraping.page.execution_results import weakest
from structlearn.testbeds.scraping.page.feedback_claims import Row, holds
from structlearn.testbeds.scraping.page.refinement_results import (
    AIMED_RATIO,
    PUBLISHED_ITERATIONS,
    RefinementResults,
)
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL


def refinement_claims(results: RefinementResults) -> list[Row]:
    """Rows of the table of claims; a statement on settings that were not executed is left out."""
    rows = _lower(results) if results.evaluated else []
    rows.append(_converges(results))
    if results.seen_deg:
        rows.append(_kept(results))
    rows += [_between(results, setting) for setting in results.between_deg]
    if results.tilted_deg:
        rows.append(_nominal(results))
    return rows


def _lower(results: RefinementResults) -> list[Row]:
    tilt = f"{results.example_deg:g}°"
    gains = {name: results.ratio(AFTER, BEFORE, name).loc[results.example_deg] for name in results.refined}
    costs = results.costs.set_index(["primitive", "model", "setting_deg"])["mean"]
    each = []
    for name, row in gains.items():
        old, new = (costs[name, model, results.example_deg] for model in (BEFORE, AFTER))
        low, high = row["lower_rad"] - row["half_width"], row["lower_rad"] + row["half_width"]
        lower = f"lower by {rounded(row['lower_rad'], '.1f')} rad, 95 % CI {interval(low, high)}"
        each.append(f"“{name}”: {old:.1f} → {new:.1f} rad; {lower}")
    shares = [f"“{name}”: {row['ratio']:.2f} of the cost before" for name, row in gains.items()]
    return [
        (
            f"Refinement by trial lowers the cost at {tilt}, on which it was made",
            "Fig. IV.20",
            f"{'; '.join(each)}; {results.runs} runs each, in pairs",
            holds({name: row["verdict"] for name, row in gains.items()}),
        ),
        (
            f"… by at least {100 * (1 - AIMED_RATIO):.0f} %",
            "this project",
            f"{'; '.join(shares)}; yes means: the ratio of the means is at most {AIMED_RATIO:g}",
            holds({name: BETTER if row["ratio"] <= AIMED_RATIO else WORSE for name, row in gains.items()}),
        ),
    ]


def _converges(results: RefinementResults) -> Row:
    each = []
    for name, rows in results.network_costs.items():
        curve = " → ".join(f"{cost:.1f}" for cost in rows)
        each.append(f"“{name}”: {curve} rad")
    return (
        f"The refinement has converged after {PUBLISHED_ITERATIONS} iterations",
        "Fig. IV.19",
        f"{'; '.join(each)}; yes means: no later iteration is proven lower, or the threshold was met by then",
        holds(results.convergence),
    )


def _kept(results: RefinementResults) -> Row:
    each = []
    for name in results.primitives:
        rows = results.kept(name)
        ratios = listing(f"{ratio:.2f}" for ratio in rows["ratio"])
        worse = rows.index[rows["verdict"] == WORSE]
        text = f"“{name}”: {ratios} of the cost before"
        if len(worse):
            text += f", proven higher at {degrees(worse)}"
        elif rows["half_width"].notna().all():
            rise = max(0.0, (rows["half_width"] - rows["lower_rad"]).max())
            text += f", the intervals allow a rise by {rise:.1f} rad at most"
        each.append(text)
    return (
        f"Settings learned from ({degrees(results.seen_deg)}) do not get worse",
        "IV.9.4.2",
        f"{'; '.join(each)}; yes means: in no setting proven worse in pairs",
        holds({name: results.not_worse(name) for name in results.primitives}),
    )


def _between(results: RefinementResults, setting: float) -> Row:
    table = results.between[results.between["setting_deg"] == setting]
    below, above = table["below_deg"].iloc[0], table["above_deg"].iloc[0]
    each = [
        f"“{name}”: "
        + ", ".join(
            f"{row.model} {row.mean_below:.1f}, {row.mean:.1f}, {row.mean_above:.1f} rad"
            for row in rows.itertuples()
        )
        for name, rows in table.groupby("primitive", sort=False)
    ]
    return (
        f"{setting:g}°, never seen, costs between {below:g}° and {above:g}°, before and after",
        "IV.9.4.2",
        f"{'; '.join(each)}; intervals by Welch",
        holds({name: weakest(rows["verdict"]) for name, rows in table.groupby("primitive", sort=False)}),
    )


def _nominal(results: RefinementResults) -> Row:
    each = []
    for name in results.primitives:
        spans = []
        for model in (BEFORE, AFTER):
            ratio = results.ratio(model, NOMINAL, name).loc[results.tilted_deg, "ratio"]
            spans.append(f"{model} {ratio.min():.2f} to {ratio.max():.2f}")
        each.append(f"“{name}”: {', '.join(spans)} of the cost without feedback")
    return (
        "Executions without feedback are the worst at every tilt, before and after",
        "IV.9.4.2",
        "; ".join(each),
        holds({name: results.nominal_is_worst(name) for name in results.primitives}),
    )
