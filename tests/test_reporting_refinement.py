import html as entities
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reporting_feedback import ADAPTED, AXIS, feedback_results
from reporting_refinement import (
    COSTS,
    CURVES,
    RUNS,
    SAMPLES,
    SETTINGS,
    UNSEEN,
    examples,
    history,
    parameters,
    refinement_results,
    scores,
    search,
)
from reporting_scraping import FIT, PARAMETERS, demonstration, scraping_results
from scipy import stats

from structlearn.feedback.supervision import SupervisionParameters
from structlearn.ground.artefacts import write_metrics, write_table
from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.recordings.source import ClockParameters
from structlearn.reporting.figures import save
from structlearn.reporting.page import Page, render
from structlearn.testbeds.scraping.page import refinement_figures, refinement_sections, refinement_snapshots
from structlearn.testbeds.scraping.page.feedback_files import read_refinement
from structlearn.testbeds.scraping.page.refinement_claims import refinement_claims
from structlearn.testbeds.scraping.page.refinement_results import metrics
from structlearn.testbeds.scraping.page.refinement_snapshots import HEIGHT_DRAWN, snapshots, turned
from structlearn.testbeds.scraping.page.scraping_page import pictures, scraping_page
from structlearn.testbeds.scraping.page.scraping_results import metrics as all_metrics
from structlearn.testbeds.scraping.page.scraping_results import tables
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL
from structlearn.testbeds.scraping.world.layout import EDGE_M, EDGE_WIDTH_M

NOTHING = pd.DataFrame()


@pytest.fixture(scope="module")
def feedback():
    return feedback_results()


@pytest.fixture(scope="module")
def bare(feedback):
    return replace(scraping_results([demonstration(seed) for seed in range(2)]), feedback=feedback)


def with_refinement(bare, **changes):
    return replace(bare, feedback=replace(bare.feedback, refinement=refinement_results(**changes)))


def page(results):
    text = render(scraping_page(results, {}, {"segment": PARAMETERS, "fit_primitives": FIT}))
    return entities.unescape(text)


def section(results):
    shown = refinement_sections.refinement(results.feedback, {})
    text = entities.unescape(render(Page("", "", (shown,))))
    return re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)


def number(name):
    return ADAPTED.index(name) + 2


def holds(results, words):
    (found,) = [row[3] for row in refinement_claims(results) if words in row[0]]
    return found


def changed(setting, **costs):
    """The costs with those of some models in one setting replaced."""
    return {model: COSTS[model] | ({setting: costs[model]} if model in costs else {}) for model in COSTS}


VARIANTS = {
    "as published": {},
    "one primitive": {
        "history": history({"turn": CURVES["turn"]}),
        "parameters": parameters(("turn",)),
        "search": search({PI2: 45.0, CMA_ES: 55.0}).query("primitive == 'turn'"),
    },
    "one run": {
        "scores": scores(runs=1),
        "history": history(runs=1),
        "examples": examples(1),
        "search": search({PI2: 45.0, CMA_ES: 55.0}, seeds=1),
    },
    "failed rollouts": {"history": history(faults={0: "diverged at 1.5 s", 3: "diverged at 0.2 s"})},
    "no search": {"search": NOTHING},
    "not evaluated where refined": {"scores": scores(settings=(0.0, 5.0)), "examples": {}},
    "only the default": {"scores": scores(settings=(0.0,)), "examples": {}},
    "nothing to do": {"history": history({name: (80.0,) for name in ADAPTED})},
    "set temperature, full covariance": {
        "parameters": parameters(search={"temperature": 0.1, "covariance": {"mode": "full"}})
    },
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_page_is_right_whatever_was_refined(bare, variant, tmp_path):
    results = with_refinement(bare, **VARIANTS[variant])
    text = section(results)
    drawn = refinement_sections.pictures(results.feedback)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', text)) == set(drawn)
    assert set(re.findall(r'href="tables/(\w+)\.csv"', text)) <= set(tables(results))
    for one in (text, str(refinement_claims(results.feedback.refinement))):
        assert not re.search(r"\bnan\b", one, flags=re.IGNORECASE)
    write_metrics(all_metrics(results), tmp_path / "metrics.json")  # raises on NaN


def test_the_whole_page_shows_every_figure(bare):
    results = with_refinement(bare)
    text = page(results)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', text)) == set(pictures(results))
    assert text.index("<h2>On the board") < text.index("<h2>Refinement by trial")
    assert "Refinement by trial lowers the cost at 10°" in text  # among the claims


def test_without_refinement_the_page_says_nothing_of_it(bare):
    assert "Refinement by trial" not in page(bare)
    assert not [name for name in (*all_metrics(bare), *tables(bare)) if "refine" in name or "rl_" in name]


def test_empty_folders_are_no_refinement_and_what_is_there_is_read(tmp_path):
    given = {
        "refine": parameters(),
        "clock": ClockParameters(rate_hz=100.0),
        "coupling_dataset": SupervisionParameters(primitives=ADAPTED, settings_deg=(5.0,)),
    }
    raw, feedback = tmp_path / "raw", tmp_path / "feedback"
    for folder in ("refined", "refinement", "search"):
        (feedback / folder).mkdir(parents=True)
    assert read_refinement(raw, feedback, given) is None
    results = refinement_results()
    write_table(results.scores, feedback / "refined" / "scores.parquet")
    write_table(NOTHING, feedback / "refinement" / "history.parquet")  # no primitive was refined
    assert read_refinement(raw, feedback, given) is None
    write_table(results.history, feedback / "refinement" / "history.parquet")
    found = read_refinement(raw, feedback, given)
    assert found.example_deg == 10.0
    assert found.search.empty
    assert found.convergence == results.convergence
    pd.testing.assert_frame_equal(found.ratios, results.ratios)


def test_all_statements_hold_where_the_data_say_so():
    assert {row[3] for row in refinement_claims(refinement_results())} == {"yes"}


def test_metrics_are_the_means_given():
    values = metrics(refinement_results(), number)
    for name in ("prim2", "prim3"):
        assert values[f"rl_cost_before_{name}"] == pytest.approx(80.0, abs=1.5)
        assert values[f"rl_cost_after_{name}"] == pytest.approx(42.0, abs=1.5)
        assert values[f"search_cost_pi2_{name}"] == pytest.approx(46.0)
        assert values[f"search_cost_cma_es_{name}"] == pytest.approx(56.0)
        assert values[f"rl_iterations_{name}"] == 3
    assert values["rl_iterations"] == 3
    assert values["rl_rollouts"] == 2 * (4 * RUNS + 3 * (SAMPLES + 2))
    assert values["rl_failed_rollouts"] == 0
    assert values["seen_cost_ratio_after_over_before_max"] == pytest.approx(29.0 / 30.0, abs=0.01)


def test_pairs_decide_what_means_cannot():
    small = scores(changed(5.0, after=29.6))  # 0.4 rad below, where runs differ by 1 rad
    found = refinement_results(scores=small)
    rows = small[(small["setting_deg"] == 5.0) & (small["primitive"] == "turn")]
    before, after = (rows.loc[rows["model"] == model, "cost_rad"].to_numpy() for model in (BEFORE, AFTER))
    assert stats.ttest_ind(before, after).pvalue > 0.05
    assert found.ratio(AFTER, BEFORE, "turn").loc[5.0, "verdict"] == BETTER
    assert stats.ttest_rel(before, after).pvalue < 0.05


def test_one_seen_setting_that_gets_worse_is_enough():
    found = refinement_results(scores=scores(changed(7.5, after=41.0)))
    assert holds(found, "do not get worse") == "no"
    only = scores(changed(7.5, after=41.0))
    good = scores()
    mixed = pd.concat([only[only["primitive"] == "turn"], good[good["primitive"] == "scrape"]])
    assert holds(refinement_results(scores=mixed), "do not get worse") == "turn: no, scrape: yes"


def test_a_seen_setting_within_noise_is_not_worse():
    table = scores(changed(5.0, after=30.0))
    found = refinement_results(scores=table)
    assert found.not_worse("turn") == BETTER
    row = found.ratio(AFTER, BEFORE, "turn").loc[5.0]
    assert row["half_width"] > abs(row["lower_rad"])


def test_the_cost_must_fall_by_30_percent():
    found = refinement_results(scores=scores(changed(10.0, after=60.0)))
    assert holds(found, "lowers the cost") == "yes"
    assert holds(found, "at least 30 %") == "no"
    assert holds(refinement_results(scores=scores(changed(10.0, after=90.0))), "lowers the cost") == "no"


def test_a_single_run_decides_nothing():
    found = refinement_results(**VARIANTS["one run"])
    assert holds(found, "lowers the cost") == UNDECIDED
    assert holds(found, "do not get worse") == UNDECIDED
    assert holds(found, "costs between") == UNDECIDED
    assert holds(found, "without feedback are the worst") == UNDECIDED
    assert holds(found, "converged") == UNDECIDED
    assert "CI unknown" in refinement_claims(found)[0][2]


def test_never_seen_must_lie_between_its_neighbours():
    assert holds(refinement_results(), f"{UNSEEN:g}°, never seen, costs between 7.5° and 10°") == "yes"
    above = refinement_results(scores=scores(changed(UNSEEN, after=50.0)))
    assert holds(above, "costs between") == "no"
    level = refinement_results(scores=scores(changed(UNSEEN, after=35.0)))  # as its neighbour below
    assert holds(level, "costs between") == UNDECIDED
    falling = {model: dict(zip(SETTINGS, (9.0, 30.0, 80.0, 60.0, 40.0), strict=True)) for model in COSTS}
    assert holds(refinement_results(scores=scores(falling)), "costs between") == "yes"


def test_no_neighbour_no_statement():
    inside = refinement_results(scores=scores(settings=(0.0, 5.0, 8.8)))
    assert inside.unseen_deg == [8.8]
    assert not [row for row in refinement_claims(inside) if "costs between" in row[0]]


def test_feedback_worse_than_none_is_told():
    found = refinement_results(scores=scores(changed(5.0, before=100.0)))
    assert holds(found, "without feedback are the worst") == "no"


@pytest.mark.parametrize(
    ("curve", "threshold", "expected"),
    [
        ((80.0, 50.0, 42.0, 42.0), 0.5, BETTER),
        ((80.0, 50.0, 45.0, 44.9, 38.0), 0.5, WORSE),  # a later gain counts, however late
        ((80.0, 50.0, 42.0, 50.0), 0.5, BETTER),  # got worse again: no improvement after the second
        ((80.0, 50.0), 3.0, BETTER),  # stopped by the threshold
        ((80.0, 50.0, 42.0), 0.5, UNDECIDED),  # stopped because no iterations were left
    ],
)
def test_convergence_is_that_no_later_iteration_is_lower(curve, threshold, expected):
    scales = {"turn": {"exploration": 1.0, "threshold_rad": threshold}}
    found = refinement_results(history=history({"turn": curve}), parameters=parameters(scales=scales))
    assert found.convergence == {"turn": expected}


def test_gains_between_iterations_are_paired():
    table = history({"turn": (80.0, 79.5, 79.0)})
    found = refinement_results(history=table, parameters=parameters(("turn",)))
    runs = table[table["kind"] == "feedback"].pivot_table("cost_rad", "number", "iteration")
    row = found.progress.set_index("iteration").loc[1]
    interval = stats.ttest_rel(runs[0], runs[1]).confidence_interval()
    assert row["lower_rad"] - row["half_width"] == pytest.approx(interval.low)
    assert row["lower_rad"] + row["half_width"] == pytest.approx(interval.high)
    assert np.isnan(row["since_lower_rad"])


def test_failed_rollouts_are_counted_by_their_fault(bare):
    results = with_refinement(bare, **VARIANTS["failed rollouts"])
    found = results.feedback.refinement
    assert found.faults["rollouts"].tolist() == [6, 6]  # two of every iteration, by primitive
    assert found.faults["fault"].unique().tolist() == ["diverged at … s"]
    assert metrics(found, number)["rl_failed_rollouts"] == 12
    text = section(results)
    assert f"12 of {len(found.history)} rollouts failed" in text
    assert "diverged at … s" in text
    samples = found.curves[(found.curves["kind"] == "sample") & (found.curves["primitive"] == "turn")]
    assert samples["mean"].notna().all()
    assert (samples["failed"] == 2).all()


def test_conclusions_on_the_searches_follow_the_numbers(bare):
    def said(**ends):
        return section(with_refinement(bare, search=search(ends)))

    assert "every search by PI2-CMA ends lower" in said(pi2=45.0, cma_es=55.0)
    assert "every search by CMA-ES ends lower" in said(pi2=55.0, cma_es=45.0)
    assert "the ranges of both overlap" in said(pi2=45.0, cma_es=46.0)
    assert "CMA-ES above the start" in said(pi2=45.0, cma_es=90.0)
    assert "3 searches per method" in said(pi2=45.0, cma_es=55.0)


def test_a_search_whose_mean_policy_failed_at_the_end_is_not_hidden():
    table = search({PI2: 45.0, CMA_ES: 55.0}, seeds=1)
    last = (table["method"] == PI2) & (table["update"] == 3) & (table["primitive"] == "turn")
    table.loc[last, "cost_rad"] = np.nan
    found = refinement_results(search=table)
    assert np.isnan(found.searched.loc[("turn", PI2), "mean"])
    values = metrics(found, number)
    assert "search_cost_pi2_prim2" not in values
    assert "search_cost_pi2_prim3" in values


def test_settings_are_named_by_what_they_were():
    found = refinement_results()
    roles = [refinement_figures.role(found, setting) for setting in SETTINGS]
    assert roles == ["default", "learned", "learned", "unseen", "refined"]


def test_published_readings_stand_beside_those_at_the_same_tilt_only(bare):
    assert "with feedback, published</td><td>0.7" in section(with_refinement(bare))
    elsewhere = with_refinement(bare, example_deg=8.8, parameters=parameters(setting_deg=8.8))
    assert "with feedback, published" not in section(elsewhere)


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
        gap = 1e3 * EDGE_WIDTH_M * np.sin(np.radians(shot.off_deg))
        assert np.ptp(heights) == pytest.approx(gap)


def test_a_tool_that_hovers_is_drawn_a_little_above_the_board():
    (run, *_) = examples()[AFTER]
    lifted = snapshots(replace(run, position=run.position + np.array([0.0, 0.0, 0.08])), 10.0, AXIS)
    near = snapshots(run, 10.0, AXIS)
    for above, on in zip(lifted, near, strict=True):
        sideways, up = above.grasp - on.grasp
        assert sideways == pytest.approx(0.0, abs=1e-9)
        assert up * np.cos(np.radians(10.0)) == pytest.approx(HEIGHT_DRAWN)  # along the board's normal


def test_the_pair_that_is_drawn_gained_the_mean():
    table = scores()
    others = (table["run"] != "02") & (table["model"] == AFTER) & (table["setting_deg"] == 10.0)
    table.loc[others, "cost_rad"] += np.where(table.loc[others, "run"] == "01", 20.0, -10.0)
    before, after = refinement_results(scores=table).pair
    assert before.name == after.name == "02"


def test_pictures_are_deterministic_and_small(bare, tmp_path):
    feedback = with_refinement(bare, **VARIANTS["failed rollouts"]).feedback
    figures = {
        "learning": refinement_figures.learning_figure,
        "cost": refinement_figures.cost_figure,
        "search": refinement_figures.search_figure,
        "snapshots": refinement_snapshots.snapshots_figure,
    }
    for name, plot in figures.items():
        for attempt in ("first", "second"):
            save(plot(feedback), tmp_path / f"{name}_{attempt}.png")
        first, second = ((tmp_path / f"{name}_{one}.png").read_bytes() for one in ("first", "second"))
        assert first == second
        assert len(first) < 200_000


def test_the_page_names_what_departs_from_the_text(bare):
    text = section(with_refinement(bare))
    for words in (
        "the author's public code: 8",
        "24 executions",
        "1 nat (KL)",
        "its shape is kept",
        "K = 38",
    ):
        assert words in text
    other = section(with_refinement(bare, **VARIANTS["set temperature, full covariance"]))
    assert "nat (KL)" not in other
    assert "its shape is kept" not in other


def test_a_key_number_tells_what_is_left_of_the_cost(bare):
    text = page(with_refinement(bare))
    (values, label) = re.search(r"<dd>([^<]*)</dd><dt>(of the cost before refinement[^<]*)", text).groups()
    shares = [float(value) for value in re.findall(r"\d+", values)]
    assert np.allclose(shares, 100.0 * 42.0 / 80.0, atol=1.5)
    assert "board at 10°" in label


def test_worse_on_the_level_board_is_said(bare):
    assert "On the level board feedback still costs something" in section(with_refinement(bare))
    assert refinement_results().ratio(AFTER, NOMINAL).loc[0.0, "verdict"] == WORSE
