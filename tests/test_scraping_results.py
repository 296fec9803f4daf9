"""The numbers that follow from executions and refinements."""

import numpy as np
import pytest
from reporting_feedback import AXIS, TELLING, dataset
from reporting_refinement import SETTINGS, examples, history, parameters, refinement_results, scores, search
from scipy import stats

from structlearn.core.metrics import BETTER
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.findings import Findings
from structlearn.testbeds.scraping.page.findings import refinement_of_one
from structlearn.testbeds.scraping.page.refinement_figures import snapshots, turned
from structlearn.testbeds.scraping.page.results import informative_channel
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.world.layout import EDGE_M, EDGE_WIDTH_M


def test_the_most_telling_channel_is_the_one_that_follows_the_tilt():
    channel, correlation = informative_channel(dataset())
    assert channel == TELLING
    assert correlation < -0.95


def test_pairs_decide_what_means_cannot():
    costs = {NOMINAL: 90.0, BEFORE: 30.0, AFTER: 29.6}  # 0.4 rad below, where runs differ by 1 rad
    small = scores({model: dict.fromkeys(SETTINGS, cost) for model, cost in costs.items()})
    found = refinement_results(scores=small)
    before, after = (found.run_costs(model, 5.0, "turn") for model in (BEFORE, AFTER))
    assert stats.ttest_ind(before, after).pvalue > 0.05
    assert found.ratio(AFTER, BEFORE, "turn").loc[5.0, "verdict"] == BETTER
    assert stats.ttest_rel(before, after).pvalue < 0.05


def test_gains_between_iterations_are_paired():
    table = history({"turn": (80.0, 79.5, 79.0)})
    found = refinement_results(history=table, parameters=parameters(("turn",)))
    runs = table[table["kind"] == "feedback"].pivot_table("cost_rad", "number", "iteration")
    row = found.progress.set_index("iteration").loc[1]
    interval = stats.ttest_rel(runs[0], runs[1]).confidence_interval()
    assert row["lower_rad"] - row["half_width"] == pytest.approx(interval.low)
    assert row["lower_rad"] + row["half_width"] == pytest.approx(interval.high)
    assert np.isnan(row["since_lower_rad"])


def test_failed_rollouts_are_counted_by_their_fault():
    found = refinement_results(history=history(faults={0: "diverged at 1.5 s", 3: "diverged at 0.2 s"}))
    assert found.faults["rollouts"].tolist() == [6, 6]  # two of every iteration, by primitive
    assert found.faults["fault"].unique().tolist() == ["diverged at … s"]
    samples = found.curve("turn", "sample")
    assert samples["mean"].notna().all()
    assert (samples["failed"] == 2).all()


def test_a_search_whose_mean_policy_failed_at_the_end_is_not_hidden():
    table = search({PI2: 45.0, CMA_ES: 55.0}, seeds=1)
    last = (table["method"] == PI2) & (table["update"] == 3) & (table["primitive"] == "turn")
    table.loc[last, "cost_rad"] = np.nan
    found = refinement_results(search=table)
    assert np.isnan(found.searched.loc[("turn", PI2), "mean"])
    find = Findings()
    refinement_of_one(find, found, ["down", "turn", "scrape"])
    values = find.numbers()
    assert "search_cost_pi2_prim2" not in values
    assert "search_cost_pi2_prim3" in values


def test_settings_are_named_by_what_they_were():
    found = refinement_results()
    roles = [found.role(setting) for setting in SETTINGS]
    assert roles == ["default", "learned", "learned", "unseen", "refined"]


def test_readings_of_the_hand_are_those_of_the_recordings():
    table = refinement_results().hand_roll.set_index(["model", "moment"])["mean_deg"]
    assert np.allclose(table[BEFORE], [0.0, 0.0, 6.0, 6.0], atol=1e-6)
    assert np.allclose(table[AFTER], [0.0, 0.0, 9.0, 9.0], atol=1e-6)
    assert np.allclose(table[NOMINAL], 0.0, atol=1e-6)


def test_snapshots_keep_recorded_angles_and_lay_the_edge_on_the_board():
    (run, *_) = examples()[AFTER]
    shots = snapshots(run, 10.0, AXIS)
    assert [shot.hand_deg for shot in shots] == pytest.approx([0.0, 0.0, 9.0, 9.0], abs=1e-6)
    assert [shot.off_deg for shot in shots] == pytest.approx([10.0, 10.0, 1.0, 1.0], abs=1e-6)
    normal = turned(np.array([0.0, 1.0]), 10.0)
    half = 500.0 * EDGE_WIDTH_M
    for shot in shots:
        corners = np.array([(-half, -1e3 * EDGE_M), (half, -1e3 * EDGE_M)])
        heights = (shot.grasp + turned(corners, shot.tool_deg)) @ normal
        assert heights.min() == pytest.approx(0.0, abs=1e-9)
        assert np.ptp(heights) == pytest.approx(1e3 * EDGE_WIDTH_M * np.sin(np.radians(shot.off_deg)))


def test_the_pair_that_is_drawn_gained_the_mean():
    table = scores()
    others = (table["run"] != "02") & (table["model"] == AFTER) & (table["setting_deg"] == 10.0)
    table.loc[others, "cost_rad"] += np.where(table.loc[others, "run"] == "01", 20.0, -10.0)
    before, after = refinement_results(scores=table).pair
    assert before.name == after.name == "02"
