import html as entities
import re
from dataclasses import replace

import numpy as np
import pytest
from reporting_feedback import (
    ADAPTED,
    CHANNELS,
    NMSE,
    SETTINGS,
    TELLING,
    comparison,
    dataset,
    feedback_results,
    orderings,
    path_errors,
    scores,
    traces,
    with_board,
    without_corrections,
    without_executions,
)
from reporting_scraping import FIT, PARAMETERS, demonstration, scraping_results

from structlearn.ground.artefacts import write_metrics
from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.reporting.figures import save
from structlearn.reporting.page import render
from structlearn.testbeds.scraping.page import board_figures, feedback_figures
from structlearn.testbeds.scraping.page.feedback_claims import feedback_claims
from structlearn.testbeds.scraping.page.feedback_results import informative_channel, unroll_traces
from structlearn.testbeds.scraping.page.scraping_page import pictures, scraping_page
from structlearn.testbeds.scraping.page.scraping_results import metrics, tables

HEADINGS = {
    "The board, the robot and the fingers",
    "Expected sensor traces",
    "Corrections",
    "Feedback models compared",
    "On the board",
}


@pytest.fixture(scope="module")
def bare():
    return scraping_results([demonstration(seed) for seed in range(2)])


@pytest.fixture(scope="module")
def feedback():
    return feedback_results()


@pytest.fixture(scope="module")
def whole(bare, feedback):
    return replace(bare, feedback=feedback)


def page(results):
    parameters = {"segment": PARAMETERS, "fit_primitives": FIT}
    return entities.unescape(render(scraping_page(results, {}, parameters)))


def headings(text):
    return {heading.strip() for heading in re.findall(r"<h2>([^<]*)", text)}


def verdicts(feedback):
    """Whether each statement holds, by its first words."""
    return {statement: holds for statement, _, _, holds in feedback_claims(feedback)}


def holds(feedback, words):
    (found,) = [verdict for statement, verdict in verdicts(feedback).items() if words in statement]
    return found


def test_sections_vanish_without_feedback_data(bare, whole, feedback):
    assert not HEADINGS & headings(page(bare))
    assert headings(page(whole)) >= HEADINGS
    own = headings(page(replace(bare, feedback=without_executions(feedback))))
    assert HEADINGS & own == {"Expected sensor traces", "Corrections", "Feedback models compared"}
    felt = headings(page(replace(bare, feedback=without_corrections(feedback))))
    assert HEADINGS & felt == {"Expected sensor traces"}


def test_without_feedback_the_page_says_nothing_of_it(bare):
    assert "feedback" not in page(bare).lower()
    assert not [name for name in (*metrics(bare), *tables(bare)) if "nmse" in name or "board" in name]


@pytest.mark.parametrize("part", [lambda f: f, without_executions, without_corrections])
def test_page_shows_every_figure_and_only_written_tables(bare, feedback, part):
    results = replace(bare, feedback=part(feedback))
    text = page(results)
    assert set(re.findall(r'<img src="figures/(\w+)\.png"', text)) == set(pictures(results))
    assert set(re.findall(r'href="tables/(\w+)\.csv"', text)) <= set(tables(results))
    assert "nan" not in re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL).lower().split()


def test_recorded_executions_are_not_labelled_simulated(bare, feedback):
    text = page(replace(bare, feedback=without_executions(feedback)))
    for heading in ("Expected sensor traces", "Corrections", "Feedback models compared"):
        assert re.search(rf"<h2>{heading}</h2>", text)
    assert "simulated person corrects" not in text


def test_page_and_pictures_are_deterministic(whole, feedback, tmp_path):
    assert page(whole) == page(whole)
    for attempt in ("first.png", "second.png"):
        save(board_figures.closed_loop_figure(feedback, "turn"), tmp_path / attempt)
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()


def test_metrics_are_the_means_given(whole, tmp_path):
    values = metrics(whole)
    for key, representation in (("pmnn", "pmnn_100"), ("ffnn_phase", "ffnn_phase"), ("ffnn", "ffnn")):
        for number in (2, 3):
            name = f"{key}_prim{number}_generalization_nmse"
            assert values[name] == pytest.approx(NMSE[representation], abs=2e-3)
            assert values[f"{name}_best_step"] == pytest.approx(NMSE[representation] - 0.02, abs=2e-3)
    for setting in ("2p5", "5", "10"):
        assert values[f"cost_ratio_feedback_over_nominal_{setting}"] == pytest.approx(0.4, abs=0.02)
        assert values[f"cost_ratio_unrolled_over_nominal_{setting}"] == pytest.approx(0.5, abs=0.02)
    assert values["cost_ratio_feedback_over_nominal_0"] > 1.0
    assert values["force_largest_error_percent"] == pytest.approx(1.0)
    assert values["roll_torque_monotone"] is True
    write_metrics(values, tmp_path / "metrics.json")  # raises on NaN


def test_all_claims_hold_where_the_data_say_so(feedback):
    assert set(verdicts(feedback).values()) == {"yes"}


def test_a_model_that_is_worse_is_called_worse(feedback):
    table = comparison(NMSE | {"pmnn_100": 0.45, "ffnn_phase": 0.6})
    worse = replace(feedback, comparison=table, orderings=orderings(table))
    assert holds(worse, "best of the network structures") == "no"
    assert holds(worse, "told the phase") == "no"
    assert holds(worse, "Order:") == "no"


def test_a_claim_about_one_primitive_is_not_one_about_both(feedback):
    table = feedback.orderings.copy()
    pair = (table["better"] == "ffnn_phase") & (table["worse"] == "ffnn")
    table.loc[pair & (table["primitive"] == "turn"), "verdict"] = UNDECIDED
    assert holds(replace(feedback, orderings=table), "told the phase") == "turn: undecided, scrape: yes"


def test_a_pair_that_was_not_compared_decides_nothing(feedback):
    table = feedback.orderings[feedback.orderings["worse"] != "ffnn"]
    found = replace(feedback, orderings=table).claim_verdicts([("pmnn_100", "ffnn")])
    assert set(found.values()) == {UNDECIDED}


def test_feedback_that_costs_more_is_said_to(bare, feedback):
    worse = with_board(feedback, scores=scores({"nominal": 4.0, "pointwise": 10.0, "unrolled": 5.0}))
    assert holds(worse, "lowers the cost") == "no"
    text = page(replace(bare, feedback=worse))
    assert "in “turn” higher at every tilt; in “scrape” higher at every tilt" in text
    assert "training in the unroll lowers the cost at 2.5°, 5° and 10°" in text


def test_a_single_run_decides_nothing(feedback):
    one = with_board(
        feedback,
        scores=feedback.board.scores.query("run == '00'"),
        traces=feedback.board.traces.query("run == '00'"),
    )
    assert holds(one, "lowers the cost") == UNDECIDED
    assert holds(one, "coupling term") == UNDECIDED


def test_feedback_at_the_default_setting_is_told(whole):
    text = page(whole)
    assert "Feedback costs something where there is nothing to correct" in text
    assert "No model has learned from this setting" in text


def test_which_training_is_better_follows_the_numbers(bare, feedback):
    text = page(replace(bare, feedback=feedback))
    assert "training in the unroll raises the cost at 2.5°, 5° and 10°" in text
    assert "its path is better in “turn” on settings learned from" in text
    text = page(replace(bare, feedback=with_board(feedback, path_errors=path_errors("pointwise"))))
    assert "its path is worse in “turn” on settings learned from" in text
    equal = feedback.board.scores.copy()
    rows = equal[equal["model"] == "pointwise"]
    wobble = np.where(rows["run"].astype(int) % 2 == 0, 0.5, -0.5)  # up in one pair, down in the next
    equal.loc[equal["model"] == "unrolled", "cost_rad"] = rows["cost_rad"].to_numpy() + wobble
    text = page(replace(bare, feedback=with_board(feedback, scores=equal)))
    assert "makes no difference that could be told at any setting: undecided" in text


def test_force_and_torque_are_judged(feedback):
    assert holds(with_board(feedback, scores=scores(force_n=0.93)), "Force control") == "no"
    bent = scores()
    bent.loc[(bent["setting_deg"] == 5.0) & (bent["primitive"] == "turn"), "roll_torque_mn_m"] = -1.0
    found = with_board(feedback, scores=bent)
    assert holds(found, "roll torque") == "turn: no, scrape: yes"
    assert found.board.torque_monotone == {"turn": False, "scrape": True}


def test_coupling_that_does_not_follow_the_tilt_is_not_told_apart(feedback):
    assert set(with_board(feedback, traces=traces(0.0)).board.coupling_verdicts.values()) <= {
        WORSE,
        UNDECIDED,
    }
    assert set(feedback.board.coupling_verdicts.values()) == {BETTER}
    assert set(with_board(feedback, traces=traces(-2.0)).board.coupling_verdicts.values()) == {BETTER}


def test_the_telling_channel_is_found_with_its_sign():
    channel, correlation = informative_channel(dataset())
    assert channel == TELLING
    assert -1.0 <= correlation < -0.9
    flat = replace(dataset(), deviation=np.ones_like(dataset().deviation))
    assert informative_channel(flat) == (0, 0.0)


def test_channels_are_named_as_electrodes_of_simulated_fingers_only(feedback):
    assert feedback.channel_name(24) == "channel 25 (right finger, electrode 6)"  # that of figure IV.18
    assert without_executions(feedback).channel_name(24) == "channel 25"


def test_expected_traces_are_those_of_the_executions(feedback):
    runs, learned = unroll_traces(feedback, "turn")
    assert runs.shape == (3, len(learned), CHANNELS)
    off, spread = feedback.expected_errors
    assert 0.0 < off < 3.0
    assert spread == pytest.approx(0.3, abs=0.15)  # the noise, and that of the offset


def test_hand_readings_are_those_of_the_recordings(feedback):
    table = feedback.board.hand_roll.set_index(["model", "moment"])
    assert np.allclose(table.loc["nominal", "mean_deg"], 0.0, atol=1e-6)
    assert np.allclose(table.loc["pointwise", "mean_deg"], [0.0, 0.0, 8.5, 8.5], atol=1e-6)
    assert table.loc[("pointwise", 3), "std_deg"] == pytest.approx(np.sqrt(0.5))


def test_perfect_demonstrations_end_flat_on_the_board(feedback):
    own = feedback.demonstrated_costs
    assert np.allclose(own["end_roll_deg"], 0.0, atol=1e-6)
    nothing_left = own[own["primitive"] == "scrape"]
    assert np.allclose(nothing_left["cost_rad"], 0.0, atol=1e-6)


def test_published_stands_beside_reproduced(whole):
    text = page(whole)
    table = text[text.index("Table IV.5") :]
    assert re.search(r"2\. turn</td><td>published</td><td>0\.15 ± 0\.05</td>.*0\.36 ± 0\.19", table)
    assert re.search(r"here, stopped by validation</td><td>0\.100 ± 0\.000</td>", table)
    assert "over 8 folds" in table
    assert "0.20 in primitive 2 (below the published 0.36)" in text
    assert "with feedback, published</td><td>0.7</td><td>2.5</td><td>5.7</td><td>3.7" in text


def test_shared_features():
    dominant = np.zeros((3, 8), dtype=bool)
    dominant[0, :2] = dominant[1, 1:3] = dominant[2, 4:6] = True
    near, far = feedback_figures.shared_features(dominant)
    assert near == pytest.approx(0.5)  # one of kernels 1 and 2, none of 2 and 3
    assert far == pytest.approx(1.0 / 3.0)


def test_the_busiest_pictures_are_small(feedback, tmp_path):
    figures = {
        "closed_loop": board_figures.closed_loop_figure(feedback, "scrape"),
        "executions": board_figures.executions_figure(feedback.board, feedback.primitives),
    }
    for name, figure in figures.items():
        save(figure, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size < 300_000


def test_every_setting_has_its_bars_and_ratios(feedback):
    for name in (*ADAPTED, "all"):
        assert list(feedback.board.ratio("pointwise", primitive=name).index) == [0.0, *SETTINGS]
