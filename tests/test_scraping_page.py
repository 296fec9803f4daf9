"""The three pages of the scraping testbed: evidence and verdicts on made-up data, and that they render."""

import runpy
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import reporting_verdicts
from committed import committed
from reporting_feedback import (
    ADAPTED,
    NMSE,
    PRIMITIVES,
    comparison,
    feedback_results,
    network,
    orderings,
    people,
    phase_weights,
)
from reporting_refinement import COSTS, forms, history, refinement_results, variants
from reporting_refinement import scores as refined_scores
from reporting_scraping import demonstration, noise_table, segmentation_results, work_table
from reporting_verdicts import AnyFigure

from structlearn.reporting.claims import (
    NO,
    NOT_TESTED,
    UNDECIDED,
    UNKNOWN,
    YES,
    claims_table,
    combined,
    read_claims,
)
from structlearn.reporting.document import render, words_in_view
from structlearn.reporting.findings import Findings
from structlearn.reporting.studies import Study
from structlearn.testbeds.scraping.page import findings as own
from structlearn.testbeds.scraping.page import page as module
from structlearn.testbeds.scraping.page.findings import ScrapingPeople, findings, share_left
from structlearn.testbeds.scraping.page.results import (
    PEOPLE,
    ScrapingResults,
    dominant_features,
    sharing_over_phase,
)
from structlearn.testbeds.scraping.page.tables import tables
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE

CLAIMS = "refinement_claims.yaml"


@pytest.fixture(scope="module")
def settings(root):
    """All parameters that the pages list."""
    models = runpy.run_path(str(root / "stages/scraping/report.py"))["PARAMETERS"]
    return {key: committed(model, key) for key, model in models.items()}


@pytest.fixture(scope="module")
def segmentation():
    return segmentation_results([demonstration(seed) for seed in range(3)])


@pytest.fixture(scope="module")
def feedback():
    return feedback_results()


@dataclass
class Made:
    """A report without its figures, which take long to draw."""

    results: ScrapingResults

    def __post_init__(self):
        self.find = findings(self.results)
        self.numbers = self.find.numbers()
        shown = tables(self.results, module.published())
        self.pages = module.pages(self.results, self.find, shown, module.published())


@pytest.fixture
def made(settings, segmentation):
    def make(feedback=None, refinement=None, segmentation=segmentation, study=None, **studies):
        studies = {PEOPLE: study} | {f"scraping/{name}": one for name, one in studies.items()}
        parts = segmentation, feedback or feedback_results(), refinement or refinement_results()
        return Made(ScrapingResults(*parts, studies, settings))

    return make


def rows(add, *results):
    """Findings that a function adds."""
    find = Findings()
    add(find, *results)
    return find


def feedback_evidence(results, count=5, **changes):
    """What a study of people like that of the results finds."""
    study = people(rows(own.feedback_of_one, results).numbers(), count, **changes)
    settings = results.board.settings_deg
    return rows(own.feedback_of_people, ScrapingPeople(study, own.OURS, PRIMITIVES), ADAPTED, settings)


def refinement_evidence(results, text=None):
    """The same of refinements, in the text's form like `text`, else like the results."""
    study = forms(refinement_numbers(results), refinement_numbers(text or results))
    find = Findings()
    for form in (own.TEXT, own.OURS):
        own.refinement_of_people(find, ScrapingPeople(study, form, PRIMITIVES), results)
    return find


def refinement_numbers(results):
    return rows(own.refinement_of_one, results, PRIMITIVES).numbers()


def sweep_evidence(results):
    return rows(own.segmentation_of_one, results)


PAGES = {"segmentation": sweep_evidence, "feedback": feedback_evidence, "refinement": refinement_evidence}


def judged(page, results):
    """By evidence, the verdicts on the cases of a page's claims; nothing is known of what was not found."""
    found = defaultdict(lambda: UNKNOWN, PAGES[page](results))
    return reporting_verdicts.cases(module.__package__, found, f"{page}_claims.yaml")


def verdicts(page, results):
    """By evidence, the verdict on a page's claims."""
    return {name: combined(list(words.values())) for name, words in judged(page, results).items()}


def test_every_claim_holds_where_the_data_say_so(feedback, segmentation):
    assert set(verdicts("feedback", feedback).values()) == {YES, NO}
    refuted = {
        "level_board",
        "level_board_ours",
        "in_the_unroll",
        "level_board_refined_text",
        "level_board_refined_ours",
    }
    for page, results in (("feedback", feedback), ("refinement", refinement_results())):
        for evidence, verdict in verdicts(page, results).items():
            assert verdict == (NO if evidence in refuted else YES), evidence
    found = verdicts("segmentation", segmentation)
    assert set(found.values()) - {NOT_TESTED} == {YES}
    assert found["downsampling_work_g2"] == YES


def test_an_undecided_or_lost_sweep_over_noise_is_no_yes(segmentation):
    for change, expected in (
        (noise_table(advantage_ms=-5.0), NO),
        (noise_table().query("seed == 0"), UNDECIDED),  # one person decides nothing
    ):
        swept = replace(segmentation, noise=change)
        assert verdicts("segmentation", swept)["least_cut_error"] == expected


def test_each_rule_of_stopping_has_its_own_rows(feedback):
    """PMNN with 100 nodes is best where the demonstration left out stops, second where validation does."""
    table = comparison()
    table.loc[
        (table["representation"] == "pmnn_100") & (table["stopping"] == "validation"), "generalization"
    ] += 0.2
    results = replace(feedback, comparison=table, orderings=orderings(table))
    found = verdicts("feedback", results)
    text = ("order_of_structures", "features_inside", "more_nodes", "level_of_error")
    assert {found[name] for name in text} == {YES}
    assert {found[f"{name}_validated"] for name in text} == {NO}
    claims = {
        claim.evidence: claim.by
        for claim in read_claims(Path(module.__file__).with_name("feedback_claims.yaml"))
    }
    assert {claims[name] for name in (*text[:3], "phase_helps")} == {"text"}
    assert {by for name, by in claims.items() if name.endswith("_validated")} == {"ours"}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda weights: weights, YES),
        (lambda weights: weights[(7 * np.arange(25)) % 25], NO),  # the next kernel shares nothing
        (lambda weights: np.tile(weights[0], (25, 1)), NO),  # the phase does not matter
    ],
    ids=["change with the phase", "kernels permuted", "equal at every phase"],
)
def test_dominant_nodes_that_do_not_follow_the_phase_refute_that_they_do(feedback, change, expected):
    networks = dict.fromkeys(ADAPTED, network(change(phase_weights())))
    assert verdicts("feedback", replace(feedback, networks=networks))["phase_dependent"] == expected


def test_sharing_of_dominant_nodes_is_nought_on_average_with_permuted_weights(feedback):
    rng = np.random.default_rng(0)
    found = [
        sharing_over_phase(dominant_features(weights))
        for weights in (rng.permuted(phase_weights(), axis=1) for _ in range(100))
    ]
    assert abs(np.mean(found)) < 2.0 * np.std(found) / 10.0
    assert np.std(found) < 0.1
    assert sharing_over_phase(dominant_features(phase_weights())) < -0.3


@pytest.mark.parametrize(("power", "expected"), [(2.0, YES), (1.0, NO), (2.5, NO)])
def test_work_that_does_not_fall_with_the_square_refutes_it(segmentation, power, expected):
    swept = replace(segmentation, downsampling_people=work_table(power))
    assert verdicts("segmentation", swept)["downsampling_work_g2"] == expected
    lone = work_table(power).query("factor == 1")  # of one factor g nothing is known
    found = verdicts("segmentation", replace(segmentation, downsampling_people=lone))
    assert found["downsampling_work_g2"] == NOT_TESTED


def test_no_two_rows_rest_on_the_same_number(made, root):
    table = pd.read_csv(root / "reports/studies/scraping/people/table.csv")
    for page in made(study=Study(table)).pages.values():
        shown = [here for one in page.judged for _, here, _, verdict in one.cases if verdict != NOT_TESTED]
        assert shown
        assert len(set(shown)) == len(shown)


def test_a_claim_about_one_primitive_is_not_one_about_both(feedback):
    numbers = rows(own.feedback_of_one, feedback).numbers()
    same = {
        "ffnn_phase_prim2_generalization_nmse_best_step": numbers["ffnn_prim2_generalization_nmse_best_step"]
    }
    study = people(numbers, **same)
    evidence = rows(own.feedback_of_people, ScrapingPeople(study, own.OURS, PRIMITIVES), ADAPTED, [])
    found = reporting_verdicts.cases(
        module.__package__, defaultdict(lambda: UNKNOWN, evidence), "feedback_claims.yaml"
    )["phase_helps"]
    assert found == {"turn": UNDECIDED, "scrape": YES}


def test_one_person_decides_nothing(made, feedback):
    pages = made(feedback).pages
    assert {one.verdict for one in pages["feedback"].judged} == {NOT_TESTED}
    for page in pages.values():
        assert "not studied with these parameters" in render(page, AnyFigure())


def test_pages_show_the_first_person_and_no_constant_is_judged_where_it_was_chosen(settings):
    people_seeds = settings["scraping_people"]
    testbed = settings["testbed"]
    assert {settings["simulate"].seed, testbed.seed, testbed.sensor_seed} == {people_seeds.shown}
    sweep = settings["segment_sweep"]
    swept = set(range(sweep.first_seed, sweep.first_seed + sweep.seeds))
    assert not swept & {*people_seeds.tuning, *people_seeds.test}


def test_people_are_judged_where_they_were_studied(made, feedback, segmentation):
    numbers = rows(own.feedback_of_one, feedback).numbers() | sweep_evidence(segmentation).numbers()
    report = made(feedback, study=people(numbers))
    assert NOT_TESTED not in {one.verdict for one in report.pages["feedback"].judged}
    assert set(claims_table(report.pages["feedback"].judged)["study"]) == {PEOPLE}
    index = claims_table(report.pages["index"].judged)
    assert set(index.loc[index["verdict"] != NOT_TESTED, "study"]) == {PEOPLE, ""}  # of this run
    assert report.numbers["people"] == 5
    nmse = report.find["level_of_error_validated"]["turn"]
    assert nmse.low < nmse.value < nmse.high
    assert nmse.value == pytest.approx(NMSE["pmnn_100"], rel=0.03)
    for page in report.pages.values():
        text = render(page, AnyFigure())
        assert words_in_view(text) <= 1500
        head = text[text.index(">Verdicts</a></h2>") : text.index('<table class="claims">')]
        assert "rest on the study scraping/people, made by unknown code, not re-run." in head
    assert "Over 5 people" in render(report.pages["feedback"], AnyFigure())


def test_a_number_that_was_not_studied_is_not_tested(feedback):
    study = people({"force_largest_error_percent": 1.0})
    found = rows(own.feedback_of_people, ScrapingPeople(study, own.OURS, PRIMITIVES), ADAPTED, [0.0])
    assert found["force_held"].value == pytest.approx(1.0, rel=0.1)
    assert {one for one in found if one != "force_held"} & set(found.numbers()) == set()


def test_the_share_left_is_the_geometric_mean_of_the_least_clear_tilt():
    rng = np.random.default_rng(0)
    clear, less = np.exp(rng.normal(np.log(0.3), 0.1, 400)), np.exp(rng.normal(np.log(0.8), 0.1, 400))
    found = share_left([clear, less])
    assert found.low < 0.8 < found.high
    assert found.n == 400
    np.testing.assert_allclose(found.value, np.exp(np.log(less).mean()))
    wider = share_left([clear, less], comparisons=12)
    assert wider.low < found.low < found.high < wider.high


def changed(setting, **costs):
    """The costs with those of some models in one setting replaced."""
    return {model: COSTS[model] | ({setting: costs[model]} if model in costs else {}) for model in COSTS}


@pytest.mark.parametrize(
    ("costs", "evidence", "expected"),
    [
        (changed(10.0, after=60.0), "lower_ours", NO),
        (changed(10.0, after=60.0), "lower_text", YES),  # less than 30 %, but lower
        (changed(10.0, after=90.0), "lower_text", NO),
        (changed(0.0, after=1.0), "level_board_refined_ours", YES),
    ],
)
def test_costs_after_refinement_decide(costs, evidence, expected):
    found = verdicts("refinement", refinement_results(scores=refined_scores(costs)))
    assert found[evidence] == expected


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        ((80.0, 50.0, 42.0, 42.0), YES),
        ((80.0, 50.0, 45.0, 44.9, 38.0), NO),  # a later gain counts, however late
        ((80.0, 50.0, 42.0, 50.0), YES),  # got worse again: no improvement after the second
        ((80.0, 50.0, 42.0), NOT_TESTED),  # no later one was run
    ],
)
def test_converged_means_that_no_later_iteration_is_much_lower(curve, expected):
    results = refinement_results(history=history({"turn": curve}))
    assert verdicts("refinement", results)["converged_text"] == expected


def test_the_dissertation_s_claims_are_decided_by_its_own_form():
    """Ours improves, the text's does not: the row of the text is no, that of ours yes."""
    worse = refinement_results(scores=refined_scores(changed(10.0, after=90.0)))
    found = refinement_evidence(refinement_results(), worse)
    words = reporting_verdicts.cases(module.__package__, defaultdict(lambda: UNKNOWN, found), CLAIMS)
    assert set(words["lower_text"].values()) == {NO}
    assert set(words["lower_ours"].values()) == {YES}
    for claim in read_claims(Path(module.__file__).with_name(CLAIMS)):
        assert claim.by == "ours" or claim.evidence.endswith("_text")


def test_people_and_studies_of_parameters_are_quoted(made, feedback):
    results = refinement_results()
    values = refinement_numbers(results)
    study = forms(values, values | {"rl_cost_ratio_prim2": 0.9})
    added = variants(values, ("1 execution", "24 executions"))
    report = made(feedback, results, study=study, added_executions=added)
    text = render(report.pages["refinement"], AnyFigure())
    assert "1 execution" in text
    assert report.numbers["lower_text_turn"] == pytest.approx(0.9, rel=0.02)
    ratio = values["rl_cost_ratio_prim2"]
    assert report.numbers["lower_ours_turn"] == pytest.approx(ratio, rel=0.02)
    assert report.numbers["rl_cost_ratio_worst_ours_turn"] > report.numbers["lower_ours_turn"]


def test_findings_are_the_means_given(made, feedback, segmentation):
    values = made(feedback, refinement_results()).numbers
    for key, representation in (("pmnn", "pmnn_100"), ("ffnn_phase", "ffnn_phase"), ("ffnn", "ffnn")):
        for number in (2, 3):
            name = f"{key}_prim{number}_generalization_nmse"
            assert values[name] == pytest.approx(NMSE[representation], abs=2e-3)
            assert values[f"{name}_best_step"] == pytest.approx(NMSE[representation] - 0.02, abs=2e-3)
    for setting in ("2p5", "5", "10"):
        assert values[f"cost_ratio_feedback_over_nominal_{setting}"] == pytest.approx(0.4, abs=0.02)
        assert values[f"cost_ratio_unrolled_over_nominal_{setting}"] == pytest.approx(0.5, abs=0.02)
    for name in ("prim2", "prim3"):
        assert values[f"rl_cost_{BEFORE}_{name}"] == pytest.approx(80.0, abs=1.5)
        assert values[f"rl_cost_{AFTER}_{name}"] == pytest.approx(42.0, abs=1.5)
        assert values[f"search_cost_pi2_{name}"] == pytest.approx(46.0)
        assert values[f"rl_cost_ratio_{name}"] == pytest.approx(42.0 / 80.0, abs=0.01)
        assert values[f"rl_later_gain_{name}"] == pytest.approx(0.0, abs=0.01)
    for primitive in ("down", "turn", "scrape"):
        assert {f"fit_{primitive}_{name}" for name in ("mean_mm", "end_mm", "mean_deg")} <= set(values)
    assert {"spread_mm_ls_down", "sweep_cut_error_ms_zvc_0p3mm", "cut_error_ms_wls"} <= set(values)
    assert values["wls_wins_at_every_noise_level"] == 1
    assert values["demonstrations_left_out"] == 0
    assert values["acceleration_jump_nominal"] < 0.05  # eq. IV.12; 100 Hz here
