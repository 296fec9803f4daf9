"""The three pages of the scraping testbed: numbers and verdicts on made-up data, and that they render."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import reporting_verdicts
from committed import committed
from reporting_feedback import (
    ADAPTED,
    AXIS,
    NMSE,
    PRIMITIVES,
    comparison,
    forms,
    network,
    orderings,
    people,
    phase_weights,
)
from reporting_refinement import COSTS, LISTED, examples, history, search, stored
from reporting_refinement import scores as refined_scores
from reporting_scraping import noise_table, work_table
from reporting_verdicts import AnyFigure

from dissertation.evidence.claims import NO, UNDECIDED, YES, claims_table, combined, read_claims
from dissertation.evidence.studies import OURS, stored_study
from dissertation.scraping.page import findings as own
from dissertation.scraping.page import page as module
from dissertation.scraping.page.board_figures import snapshots, turned
from dissertation.scraping.page.stored import PEOPLE, Stored
from dissertation.scraping.page.tables import (
    board_tables,
    curve,
    cut_tables,
    derived,
    hand_readings,
    refinement_tables,
    tables,
)
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.sample_efficiency import CMA_ES, PI2
from dissertation.scraping.world.layout import EDGE_M, EDGE_WIDTH_M
from structlearn.reporting.document import render, words_in_view
from structlearn.reporting.evidence import NOT_TESTED, UNKNOWN
from structlearn.reporting.findings import Findings

CLAIMS = "refinement_claims.yaml"
PRINTED = module.published()


@pytest.fixture(scope="module")
def settings():
    """All parameters that the pages list."""
    return {key: committed(model, key) for page in LISTED.values() for key, model in page.items()}


@dataclass
class Made:
    """A report without its figures, which take long to draw."""

    stored: Stored

    def __post_init__(self):
        frames = derived(self.stored, PRINTED)
        self.find = own.findings(self.stored, frames)
        self.numbers = self.find.numbers()
        self.pages = module.pages(self.stored, frames, self.find, tables(frames), PRINTED, LISTED)


def rows(add, *results):
    """Findings that a function adds."""
    find = Findings()
    add(find, *results)
    return find


def sweep_evidence(its):
    return rows(own.segmentation_of_one, its, cut_tables(its))


def feedback_numbers(its):
    return rows(own.feedback_of_one, its, board_tables(its, PRINTED)).numbers()


def feedback_evidence(its, count=5, **changes):
    """What a study of people like that of the results finds."""
    study = people(feedback_numbers(its), count, **changes)
    return rows(own.feedback_of_people, own.ScrapingPeople(study, OURS, PRIMITIVES), its)


def refinement_numbers(its):
    return rows(own.refinement_of_one, its, refinement_tables(its, PRINTED)).numbers()


def refinement_evidence(its, published=None):
    """The same of refinements, as published like `published`, else like the results."""
    ours = refinement_numbers(its)
    study = forms({OURS: ours, own.PUBLISHED: refinement_numbers(published) if published else ours})
    find = Findings()
    for form in (own.PUBLISHED, OURS):
        own.refinement_of_people(find, own.ScrapingPeople(study, form, PRIMITIVES), its)
    return find


PAGES = {"segmentation": sweep_evidence, "feedback": feedback_evidence, "refinement": refinement_evidence}


def judged(page, results):
    """By evidence, the verdicts on the cases of a page's claims; nothing is known of what was not found."""
    found = defaultdict(lambda: UNKNOWN, PAGES[page](results))
    return reporting_verdicts.cases(module.__package__, found, f"{page}_claims.yaml")


def verdicts(page, results):
    """By evidence, the verdict on a page's claims."""
    return {name: combined(list(words.values())) for name, words in judged(page, results).items()}


def test_every_claim_holds_where_the_data_say_so():
    assert set(verdicts("feedback", stored()).values()) == {YES, NO}
    refuted = {"in_the_unroll", "level_board", "level_board_ours"}
    refuted |= {"level_board_refined_published", "level_board_refined_ours"}
    for page in ("feedback", "refinement"):
        for evidence, verdict in verdicts(page, stored()).items():
            assert verdict == (NO if evidence in refuted else YES), evidence
    found = verdicts("segmentation", stored())
    assert set(found.values()) - {NOT_TESTED} == {YES}
    assert found["downsampling_work_g2"] == YES


def changed(setting, **costs):
    """Scores of refinement with the costs of some models in one setting replaced."""
    every = {model: COSTS[model] | ({setting: costs[model]} if model in costs else {}) for model in COSTS}
    return {"refined_scores": refined_scores(every)}


def curve_of(*costs):
    return {"history": history({"turn": costs})}


def weights(phase_weights):
    return {"networks": dict.fromkeys(ADAPTED, network(phase_weights))}


CHANGES = [
    ("segmentation", {"noise": noise_table(advantage_ms=-5.0)}, "least_cut_error", NO),
    ("segmentation", {"noise": noise_table().query("seed == 0")}, "least_cut_error", UNDECIDED),  # one person
    *(
        ("segmentation", {"downsampling_people": table}, "downsampling_work_g2", verdict)
        for table, verdict in (
            (work_table(1.0), NO),  # the work falls with the square of g
            (work_table(2.5), NO),
            (work_table().query("factor == 1"), NOT_TESTED),
        )
    ),
    # neighbours differ, or all are equal
    ("feedback", weights(phase_weights()[(7 * np.arange(25)) % 25]), "phase_dependent", NO),
    ("feedback", weights(np.tile(phase_weights()[0], (25, 1))), "phase_dependent", NO),
    ("refinement", changed(10.0, after=60.0), "lower_ours", NO),
    ("refinement", changed(10.0, after=60.0), "lower_published", YES),  # less than 30 %, but lower
    ("refinement", changed(10.0, after=90.0), "lower_published", NO),
    ("refinement", changed(0.0, after=1.0), "level_board_refined_ours", YES),
    ("refinement", curve_of(80.0, 50.0, 42.0, 42.0), "converged_published", YES),
    ("refinement", curve_of(80.0, 50.0, 45.0, 44.9, 38.0), "converged_published", NO),  # a later gain counts
    ("refinement", curve_of(80.0, 50.0, 42.0, 50.0), "converged_published", YES),  # worse again
    ("refinement", curve_of(80.0, 50.0, 42.0), "converged_published", NOT_TESTED),  # no later one was run
]


@pytest.mark.parametrize(("page", "change", "evidence", "expected"), CHANGES)
def test_verdicts_follow_the_data(page, change, evidence, expected):
    assert verdicts(page, stored(**change))[evidence] == expected


def test_each_rule_of_stopping_has_its_own_rows():
    """PMNN with 100 nodes is best where the demonstration left out stops, second where validation does."""
    table = comparison()
    table.loc[
        (table["representation"] == "pmnn_100") & (table["stopping"] == "validation"), "generalization"
    ] += 0.2
    found = verdicts("feedback", stored(comparison=table, orderings=orderings(table)))
    stated = ("order_of_structures", "features_inside", "more_nodes", "level_of_error")
    assert {found[name] for name in stated} == {YES}
    assert {found[f"{name}_validated"] for name in stated} == {NO}
    claims = {
        claim.evidence: claim.by
        for claim in read_claims(Path(module.__file__).with_name("feedback_claims.yaml"))
    }
    assert {claims[name] for name in (*stated[:3], "phase_helps")} == {"published"}
    assert {by for name, by in claims.items() if name.endswith("_validated")} == {"ours"}


def test_no_two_rows_rest_on_the_same_number(root):
    study = stored_study(root / "reports/studies/scraping/people")
    for page in Made(stored(study=study)).pages.values():
        shown = [here for one in page.judged for _, here, _, verdict in one.cases if verdict != NOT_TESTED]
        assert shown
        assert len(set(shown)) == len(shown)


def test_one_person_decides_nothing():
    page = Made(stored()).pages["feedback"]
    assert {one.verdict for one in page.judged} == {NOT_TESTED}
    assert "not studied with these parameters" in render(page, AnyFigure())


def test_pages_show_the_first_person_and_no_constant_is_judged_where_it_was_chosen(settings):
    people_seeds = settings["scraping_people"]
    testbed = settings["testbed"]
    assert {settings["simulate"].seed, testbed.seed, testbed.sensor_seed} == {people_seeds.shown}
    sweep = settings["segment_sweep"]
    swept = set(range(sweep.first_seed, sweep.first_seed + sweep.seeds))
    assert not swept & {*people_seeds.tuning, *people_seeds.test}


def test_people_are_judged_where_they_were_studied():
    study = people(feedback_numbers(stored()) | sweep_evidence(stored()).numbers())
    report = Made(stored(study=study))
    assert NOT_TESTED not in {one.verdict for one in report.pages["feedback"].judged}
    assert set(claims_table(report.pages["feedback"].judged)["study"]) == {PEOPLE}
    index = claims_table(report.pages["index"].judged)
    assert set(index.loc[index["verdict"] != NOT_TESTED, "study"]) == {PEOPLE, ""}  # of this run
    assert report.numbers["people"] == 5
    nmse = report.find["level_of_error_validated"]["turn"]
    assert nmse.low < nmse.value < nmse.high
    assert nmse.value == pytest.approx(NMSE["pmnn_100"], rel=0.03)
    texts = {name: render(page, AnyFigure()) for name, page in report.pages.items()}
    for text in texts.values():
        assert words_in_view(text) <= 1000
        head = text[text.index(">Verdicts</a></h2>") : text.index('<table class="claims">')]
        assert "rest on the study scraping/people, made by unknown code, not repeated since." in head
    assert "Over 5 people" in texts["feedback"]


def test_the_share_left_is_the_geometric_mean_of_the_least_clear_tilt():
    rng = np.random.default_rng(0)
    clear, less = np.exp(rng.normal(np.log(0.3), 0.1, 400)), np.exp(rng.normal(np.log(0.8), 0.1, 400))
    found = own.share_left([clear, less])
    assert found.low < 0.8 < found.high
    assert found.n == 400
    np.testing.assert_allclose(found.value, np.exp(np.log(less).mean()))
    wider = own.share_left([clear, less], comparisons=12)
    assert wider.low < found.low < found.high == wider.high  # "no" takes more, "yes" does not


def test_the_dissertation_s_claims_are_decided_by_its_own_form():
    """Ours improves, the published form does not: its row is no, that of ours yes."""
    found = refinement_evidence(stored(), stored(**changed(10.0, after=90.0)))
    words = reporting_verdicts.cases(module.__package__, defaultdict(lambda: UNKNOWN, found), CLAIMS)
    assert set(words["lower_published"].values()) == {NO}
    assert set(words["lower_ours"].values()) == {YES}
    for claim in read_claims(Path(module.__file__).with_name(CLAIMS)):
        assert claim.by == "ours" or claim.evidence.endswith("_published")


def test_findings_are_the_means_given():
    values = Made(stored()).numbers
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


def test_failed_rollouts_are_counted_by_their_fault():
    failing = stored(history=history(faults={0: "diverged at 1.5 s", 3: "diverged at 0.2 s"}))
    found = refinement_tables(failing, PRINTED)
    assert found["refinement_faults"]["rollouts"].tolist() == [6, 6]  # two of every iteration, by primitive
    assert found["refinement_faults"]["fault"].unique().tolist() == ["diverged at … s"]
    samples = curve(found["refinement_curves"], "turn", "sample")
    assert samples["mean"].notna().all()
    assert (samples["failed"] == 2).all()


def test_a_search_whose_mean_policy_failed_at_the_end_is_not_hidden():
    table = search({PI2: 45.0, CMA_ES: 55.0}, seeds=1)
    last = (table["method"] == PI2) & (table["update"] == 3) & (table["primitive"] == "turn")
    table.loc[last, "cost_rad"] = np.nan
    values = refinement_numbers(stored(search=table))
    assert "search_cost_pi2_prim2" not in values
    assert "search_cost_pi2_prim3" in values


@pytest.mark.parametrize(("model", "turned"), [(BEFORE, 6.0), (AFTER, 9.0), (NOMINAL, 0.0)])
def test_readings_of_the_hand_are_those_of_the_recordings(model, turned):
    means = hand_readings(examples()[model], AXIS)["mean"]
    assert np.allclose(means, [0.0, 0.0, turned, turned], atol=1e-6)


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
