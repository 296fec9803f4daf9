"""The table of ablations from made-up experiments."""

from itertools import product

import pandas as pd
import pytest
from committed import committed

from structlearn.policy_search.rollouts import FEEDBACK, IMPROVED, SAMPLE
from structlearn.reporting.document import render
from structlearn.testbeds.scraping.page.ablation_page import (
    Experiment,
    Variant,
    ablation_page,
    metrics,
    outcomes,
    summary,
)
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL

PARAMETERS = committed(BoardRefinementParameters, "refine", setting_deg=10.0, settings_deg=(5.0, 7.5))
VARIANTS = (Variant("default", "as it is"), Variant("few", "K = 2", "refine.search.samples=2"))
COSTS = {NOMINAL: 4.0, BEFORE: 2.0}


def experiment(variant, seed, after, seen_after=2.0, samples=3, iterations=2):
    """Costs are 2 before, and `after` or `seen_after` after, for both primitives and two runs."""
    afterwards = {5.0: seen_after * 5.0 / 7.5, 7.5: seen_after, 10.0: after}
    scores = [
        (*keys, COSTS.get(keys[0], afterwards[keys[1]]))
        for keys in product((NOMINAL, BEFORE, AFTER), afterwards, ("turn", "scrape"), ("01", "02"))
    ]
    columns = ["model", "setting_deg", "primitive", "run", "cost_rad"]
    history = [
        {"primitive": name, "iteration": iteration, "kind": kind, "fault": "diverged" if number == 2 else ""}
        for name in ("turn", "scrape")
        for iteration in range(iterations + 1)
        for kind, count in ((FEEDBACK, 2), *(((SAMPLE, samples), (IMPROVED, 1)) if iteration else ()))
        for number in range(count)
    ]
    return Experiment(variant, seed, pd.DataFrame(history), pd.DataFrame(scores, columns=columns))


@pytest.fixture
def table():
    experiments = [
        experiment("default", 0, 1.0),
        experiment("default", 1, 0.5),
        experiment("few", 0, 1.5, seen_after=3.0, samples=2, iterations=1),
    ]
    return outcomes(experiments, PARAMETERS)


def test_ratios_are_of_mean_costs_in_the_refined_and_in_seen_settings(table):
    assert table["turn_ratio"].tolist() == table["scrape_ratio"].tolist() == [0.5, 0.25, 0.75]
    assert table["seen_ratio"].tolist() == [1.0, 1.0, 1.5]


def test_all_rollouts_are_counted_and_those_of_policies_apart(table):
    assert table["rollouts"].tolist() == [2 * (2 + 2 * 6), 2 * (2 + 2 * 6), 2 * (2 + 5)]
    assert table["executed"].tolist() == [2 * 2 * 4, 2 * 2 * 4, 2 * 3]
    assert table["failed"].tolist() == [4, 4, 0]
    assert table["turn_iterations"].tolist() == [2, 2, 1]


def test_the_summary_has_means_over_seeds(table):
    short = summary(table).set_index("variant")
    assert list(short.index) == ["default", "few"]
    assert short.loc["default", "turn_ratio"] == pytest.approx(0.375)
    assert metrics(table)["turn_ratio_default"] == pytest.approx(0.375)
    assert metrics(table)["seen_ratio_few"] == pytest.approx(1.5)


def test_the_page_names_every_change_and_the_range_over_seeds(table):
    page, tables = ablation_page(table, PARAMETERS, VARIANTS)
    text = render(page, {})
    assert set(tables) >= {"refinement", "refinement_seeds"}
    assert "K = 2" in text
    assert "refine.search.samples=2" in text
    assert "0.38 (0.25 to 0.50)" in text
    assert "1.50" in text
    assert "(1.50" not in text  # one seed has no range
