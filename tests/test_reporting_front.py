"""The front page: it names claims that exist, shows every recorded set, indexes the whole dissertation."""

import re

import numpy as np
import pandas as pd
import pytest
from committed import ROOT, read_yaml

from dissertation.evidence.forest_figures import RECORDED, SIMULATED, Mark, Strip, draw_strip, forest_figure
from dissertation.evidence.front import (
    Experiment,
    Place,
    Row,
    Tile,
    answers_of,
    findings_table,
    forest_strips,
    read_claims_of,
    read_front_page,
    recorded_answers,
    render_front,
    tile,
)
from structlearn.core.errors import InputError
from structlearn.reporting.document import Provenance
from structlearn.reporting.figure_style import canvas

PAGE = read_front_page(ROOT / "stages/report.yaml")
ROWS = [one.simulated for one in PAGE.experiments if one.simulated]
TILES = [tile for card in PAGE.cards.values() for tile in card.tiles]
CLAIM_FILES = {
    file: read_yaml(file)
    for folder in ("src", "stages")
    for file in (ROOT / folder).rglob("*.yaml")
    if "claims" in file.as_posix() and file.stem != "published"
}


def claim(evidence, case, value, low, high, verdict, **more):
    """A row of `claims.csv`."""
    number = f"{value:g}"
    row = {"evidence": evidence, "by": "published", "statement": evidence, "case": case, "number": number}
    row |= {"value": value, "low": low, "high": high, "here": f"{number} [{low:g}, {high:g}] of the cost"}
    row |= {"unit": "of the cost", "test": "below", "bound": "1", "n": 8, "page": "index", "set": ""}
    return row | {"verdict": verdict, "verdict_of_all": verdict} | more


SCRAPING = pd.DataFrame(
    [
        claim("cost", "Turn", 0.55, 0.47, 0.64, "yes", verdict_of_all="undecided", page="feedback"),
        claim("cost", "Scrape", 0.36, 0.21, 1.61, "undecided", page="feedback"),
        claim("hits", "", 0.0, 0.0, 0.0, "yes", test="zero", bound="0"),
        claim("reach", "", np.nan, np.nan, np.nan, "not tested", by="ours", here="not tested"),
    ]
)
RECORDED_CLAIMS = pd.DataFrame(
    [
        claim("paid", "", 0.9, 0.8, 1.0, "yes", set="A robot"),
        claim("paid", "", 1.4, 1.2, 1.6, "no", set="Another robot"),
        claim("paid", "", np.nan, np.nan, np.nan, "not tested", set="Absent robot"),
        claim("ms", "0 mm", 2, 1, 3, "undecided", set="A robot", unit="ms", test="at least", bound="1.5"),
        claim("ms", "1 mm", 7, 6, 8, "yes", set="A robot", unit="ms", test="at least", bound="5")
        | {"verdict_of_all": "undecided"},
    ]
)
CLAIMS = {"scraping": SCRAPING, "recorded": RECORDED_CLAIMS}
PAYS = Experiment(
    question="Does it pay?",
    published="yes",
    printed=(0.5,),
    simulated=Row(report="scraping", claim="cost"),
    recorded=("paid", "ms"),
)
AIM = Experiment(question="Does it reach?", simulated=Row(report="scraping", claim="reach"))
BEATS = Experiment(question="Does it beat rivals?", simulated=Row(report="rivals", claim="beaten"))
OURS = PAGE.model_copy(
    update={"chapters": {"I": (PAYS,)}, "aims": (AIM,), "rivals": (), "cards": {}, "index": ()}
)


def test_an_answer_has_the_case_that_decides_and_links_to_its_row():
    (found,) = answers_of(PAYS, CLAIMS)
    assert (found.verdict, found.link) == ("undecided", "scraping/feedback.html#cost")
    assert found.deciding == "Scrape: 0.36 [0.21, 1.61] of the cost (one of 2 cases)"
    turn = PAYS.model_copy(update={"simulated": Row(report="scraping", claim="cost", cases=("Turn",))})
    assert answers_of(turn, CLAIMS)[0].deciding == "Turn: 0.55 [0.47, 0.64] of the cost"
    for gone in (Row(report="scraping", claim="gone"), Row(report="scraping", claim="cost", cases=("Up",))):
        with pytest.raises(InputError, match=rf"^scraping: claim {gone.claim}.*: the front page names it"):
            answers_of(PAYS.model_copy(update={"simulated": gone}), CLAIMS)


def test_every_set_that_was_run_is_shown_also_where_it_disagrees():
    found = recorded_answers(PAYS, RECORDED_CLAIMS)
    assert [(one.heading, one.verdict) for one in found] == [
        ("A robot", "yes"),
        ("Another robot", "no"),
        ("A robot", "undecided"),
    ]
    assert found[1].link == "recorded/index.html#another-robot-paid"


def test_the_page_has_aims_apart_and_counts_a_statement_once():
    twice = pd.concat([SCRAPING, SCRAPING])  # as on two pages
    again = pd.concat([RECORDED_CLAIMS, SCRAPING.assign(set="A robot")])  # and on recorded data
    card = next(iter(PAGE.cards.values())).model_copy(update={"tiles": ()})
    page = OURS.model_copy(update={"cards": {"scraping": card}})
    html = render_front(
        page, {"scraping": twice, "recorded": again}, {"pour": "tasks/pour/index.html"}, [], Provenance("x")
    )
    findings, _, aims = html.partition('<section id="aims">')
    assert "Does it pay?" in findings
    assert "Does it pay?" not in aims
    assert "Does it reach?" in aims
    of_all = re.search(r"Distinct statements of the dissertation.*", html)[0]
    assert re.findall(r">(\d+ [a-z ]+)<", of_all) == ["1 yes", "1 no", "2 undecided"]
    of_scraping = re.search(r">Statements:.*", html)[0]
    assert re.findall(r">(\d+ [a-z ]+)<", of_scraping) == ["1 yes", "1 undecided"]
    assert '<a href="tasks/pour/index.html">pour</a>' in html


def test_rivals_stand_in_a_section_of_their_own_also_where_they_win():
    page = OURS.model_copy(update={"rivals": (BEATS,)})
    assert page.reports == ["scraping", "rivals"]
    lost = pd.DataFrame([claim("beaten", "Transformer", 1.5, 1.2, 1.9, "no", by="ours")])
    html = render_front(page, CLAIMS | {"rivals": lost}, {}, [], Provenance("x"))
    section = html.partition('<section id="rivals">')[2].partition("</section>")[0]
    assert 'href="rivals/index.html#beaten"' in section
    assert "1 no" in section


def test_the_table_of_the_readme_has_the_verdicts_on_each_experiment():
    lines = findings_table(OURS, CLAIMS).splitlines()
    assert lines[2:] == ["| Does it pay? | undecided | yes, no, undecided |"]  # and no aim of ours


def test_a_tile_has_the_number_without_its_interval():
    assert tile(Tile(report="scraping", claim="cost", words="remain"), CLAIMS) == ("0.55", "remain")
    absent = Tile(report="recorded", set="Absent robot", claim="gone", words="remain")
    assert tile(absent, CLAIMS) == ("not recorded here", "remain")


def test_numbers_in_one_unit_with_one_bound_are_on_one_strip():
    first, *times = forest_strips(OURS, CLAIMS)
    assert (first.unit, first.bounds, first.side, first.printed) == ("of the cost", (1.0,), -1, (0.5,))
    assert first.labels == ("simulated", "A robot", "Another robot")  # no mark of what was not tested
    assert [(mark.where, mark.value) for mark in first.marks] == [
        (SIMULATED, 0.55),
        (SIMULATED, 0.36),
        (RECORDED, 0.9),
        (RECORDED, 1.4),
    ]
    assert [(one.labels, one.bounds, one.side) for one in times] == [
        (("A robot, 0 mm",), (1.5,), 1),
        (("A robot, 1 mm",), (5.0,), 1),
    ]
    counted = PAYS.model_copy(update={"simulated": Row(report="scraping", claim="hits"), "recorded": ()})
    page = OURS.model_copy(update={"chapters": {"I": (counted,)}})
    assert forest_strips(page, CLAIMS) == []  # a count that must be zero has no interval


@pytest.mark.parametrize(
    ("side", "bounds", "expected"),
    [(1, (1.0,), (1.0, None)), (-1, (1.0,), (None, 1.0)), (0, (1.0, 2.0), (1.0, 2.0))],
)
def test_the_shaded_side_is_that_on_which_the_statement_holds(side, bounds, expected):
    (strip,) = [one for one in forest_strips(OURS, CLAIMS) if one.printed]
    axes = canvas(1.0).subplots()
    draw_strip(axes, Strip("", (), "", strip.marks, bounds, side))
    shade = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    ends = [given or own for given, own in zip(expected, axes.get_xlim(), strict=True)]
    assert (shade.x0, shade.x1) == pytest.approx(ends)
    assert axes.get_xlim()[0] < 0.21
    assert axes.get_xlim()[1] > 1.61  # the longest interval is seen whole


def test_an_axis_is_logarithmic_if_all_is_positive_and_far_apart():
    near = forest_strips(OURS, CLAIMS)[0]
    apart = Strip("", (), "", [*near.marks, Mark(SIMULATED, 50.0, 40.0, 60.0)], (1.0,), 1)
    for strip, scale in (
        (near, "linear"),
        (apart, "log"),
        (Strip("", (), "", apart.marks, (0.0,), 1), "linear"),
    ):
        axes = canvas(1.0).subplots()
        draw_strip(axes, strip)
        assert axes.get_xscale() == scale
        assert (
            1
            <= len([one for one in axes.get_xticks() if axes.get_xlim()[0] <= one <= axes.get_xlim()[1]])
            <= 4
        )


def test_the_forest_has_two_panels_of_one_height_that_fit_a_page():
    many = [
        Strip(f"{one.question} {number}", one.labels, one.unit, one.marks, one.bounds, one.side)
        for number in range(8)
        for one in forest_strips(OURS, CLAIMS)
    ]
    panels = forest_figure(many)
    assert [len(panel.axes) for panel in panels] == [12, 12]
    assert panels[0].get_figheight() == panels[1].get_figheight() < 8.0
    assert [len(panel.legends) for panel in panels] == [1, 0]
    panels[0].canvas.draw()
    for label in panels[0].texts:  # beside the axes, or above them
        box = label.get_window_extent().transformed(panels[0].transFigure.inverted())
        assert not any(axes.get_position().overlaps(box) for axes in panels[0].axes), label.get_text()


def test_every_claim_and_set_that_the_page_names_exists():
    names = {}
    for file, claims in CLAIM_FILES.items():
        report = file.parents[1].name if file.parent.name == "page" else "recorded"
        names.setdefault(report, set()).update(one["evidence"] for one in claims)
    assert [one for one in (*ROWS, *TILES) if one.claim not in names[one.report]] == []
    assert {claim for one in PAGE.experiments for claim in one.recorded} - names["recorded"] == set()
    kinds = read_yaml(ROOT / "src/dissertation/recorded/public.yaml")
    titles = {entry.get("title") for entries in kinds.values() for entry in entries.values()}
    assert {one.set for one in TILES if one.report == "recorded"} <= titles


def test_the_index_has_every_figure_and_table_of_the_dissertation_once():
    numbers = {"II": (6, 0), "III": (2, 2), "IV": (21, 5)}
    expected = [
        f"{kind} {chapter}.{number}"
        for chapter, counts in numbers.items()
        for kind, count in zip(("figure", "table"), counts, strict=True)
        for number in range(1, count + 1)
    ]
    assert sorted(one.what for one in PAGE.index) == sorted(expected)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"why": ""}, "figure I.1: say why it is weaker"),
        ({"page": ""}, "figure I.1: needs a page unless it is missing"),
        ({"result": "missing"}, "figure I.1: needs a page unless it is missing"),
    ],
)
def test_a_place_says_why_it_is_not_the_same(changes, message):
    entry = {"what": "figure I.1", "shows": "a robot", "page": "a.html", "result": "weaker", "why": "it is"}
    Place(**entry)
    with pytest.raises(ValueError, match=message):
        Place(**entry | changes)


def test_claims_without_numbers_are_refused(tmp_path):
    (tmp_path / "claims.csv").write_text("evidence,here\ncost,0.5\n")
    with pytest.raises(InputError, match="has no numbers of claims; make the report of scraping again"):
        read_claims_of("scraping", tmp_path)


def test_the_drawing_follows_the_pipeline():
    """The stage of every box needs, directly or not, what the stage of the box before it makes."""
    stages = read_yaml(ROOT / "dvc.yaml")["stages"]
    makes = {
        (out if isinstance(out, str) else next(iter(out))): name
        for name, stage in stages.items()
        for out in stage.get("outs", [])
    }

    def before(name):
        direct = {makes[dep] for dep in stages[name]["deps"] if dep in makes}
        return direct.union(*(before(one) for one in direct)) if direct else set()

    for first, then in zip(PAGE.steps, PAGE.steps[1:], strict=False):
        assert first.stage in before(then.stage), f"{then.name} does not come from {first.name}"


def test_the_readme_has_the_table_of_findings():
    """`make repro` puts it there."""
    readme = (ROOT / "README.md").read_text()
    own = readme.partition("<!-- findings -->\n")[2].partition("\n<!-- end of findings -->")[0]
    assert own == (ROOT / "reports/findings.md").read_text().rstrip("\n")
    assert own.count("\n") == 1 + sum(map(len, PAGE.chapters.values()))


def test_the_counterpart_of_a_claim_about_recorded_data_exists():
    """It names the finding of one claim of a testbed."""
    claims = [(file.as_posix(), claim) for file, its in CLAIM_FILES.items() for claim in its]
    for like in (claim["simulated"] for _, claim in claims if "simulated" in claim):
        own = [one["evidence"] for file, one in claims if f"dissertation/{like['testbed']}/" in file]
        assert own.count(like["evidence"]) == 1, like["evidence"]
