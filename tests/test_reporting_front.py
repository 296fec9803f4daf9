"""The front page: its words name claims that exist, and its drawing follows the pipeline."""

import pandas as pd
import pytest
from committed import ROOT, read_yaml

from dissertation.evidence.front import Row, answer, read_front_page, render_front
from structlearn.core.errors import InputError
from structlearn.reporting.document import Provenance

PAGE = read_front_page(ROOT / "stages/report.yaml")
ROWS = [row for one in PAGE.findings for row in (one.simulated, one.recorded) if row]
TILES = [tile for card in PAGE.cards.values() for tile in card.tiles]
CLAIM_FILES = {
    file: read_yaml(file)
    for folder in ("src", "stages")
    for file in (ROOT / folder).rglob("*.yaml")
    if "claims" in file.as_posix() and file.stem != "published"
}
CLAIMS = pd.DataFrame(
    [
        ("published", "Turn", "0.55 [0.47, 0.64] of the cost", "yes", "undecided", "cost"),
        ("published", "Scrape", "0.36 [0.21, 1.61] of the cost", "undecided", "undecided", "cost"),
        ("published", "", "2.2 % [0.0, 4.8] over 8 people, [1.1, 4.4] pooled", "yes", "yes", "hits"),
        ("ours", "", "not tested: no network met the criterion", "not tested", "not tested", "reach"),
    ],
    columns=["by", "case", "here", "verdict", "verdict_of_all", "evidence"],
)


def row(claim, words, **options):
    return Row(report="scraping", claim=claim, words=words, **options)


def test_words_take_the_numbers_and_the_verdict_of_a_claim():
    for its, expected in (
        (row("cost", "{Turn} and {Scrape} are left"), ("0.55 and 0.36 are left", "undecided")),
        (row("cost", "{Turn} is left", cases=["Turn"]), ("0.55 is left", "yes")),
        (row("hits", "{value} | of spheres"), ("2.2 % | of spheres", "yes")),
        (row("reach", "{value} m"), ("not tested: no network met the criterion", "not tested")),
    ):
        assert answer(its, {"scraping": CLAIMS}) == expected
    with pytest.raises(InputError, match="claim gone: the front page names it"):
        answer(row("gone", ""), {"scraping": CLAIMS})
    with pytest.raises(InputError, match="has no case 'Down'"):
        answer(row("cost", "{Down}"), {"scraping": CLAIMS})


def test_every_claim_and_set_that_the_page_names_exists():
    names = {}
    for file, claims in CLAIM_FILES.items():
        report = file.parents[1].name if file.parent.name == "page" else "recorded"
        names.setdefault(report, set()).update(one["evidence"] for one in claims)
    assert {(one.report, one.claim) for one in (*ROWS, *TILES) if one.claim not in names[one.report]} == set()
    kinds = read_yaml(ROOT / "src/dissertation/recorded/public.yaml")
    titles = {entry.get("title") for entries in kinds.values() for entry in entries.values()}
    assert {row.set for row in (*ROWS, *TILES) if row.report == "recorded"} <= titles


def test_the_page_counts_the_statements_of_the_dissertation():
    tiles = (row("hits", "{value} | of spheres"),)
    card = next(iter(PAGE.cards.values())).model_copy(update={"tiles": tiles})
    page = PAGE.model_copy(update={"cards": {"scraping": card}, "findings": ()})
    html = render_front(
        page, {"scraping": CLAIMS}, {"pour": "tasks/pour/index.html"}, Provenance("unknown commit")
    )
    assert "<b>2.2 %</b> of spheres" in html
    assert html.count("1 yes") == html.count("1 undecided") == 2  # of the card, and of all testbeds
    assert '<a href="tasks/pour/index.html">pour</a>' in html


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
    table = readme.partition("<!-- findings -->\n")[2].partition("\n<!-- end of findings -->")[0]
    assert table == (ROOT / "reports/findings.md").read_text().rstrip("\n")
    assert table.count("\n") == 1 + len(PAGE.findings)


def test_the_counterpart_of_a_claim_about_recorded_data_exists():
    """It names the finding of one claim of a testbed."""
    claims = [(file.as_posix(), claim) for file, its in CLAIM_FILES.items() for claim in its]
    for like in (claim["simulated"] for _, claim in claims if "simulated" in claim):
        own = [one["evidence"] for file, one in claims if f"dissertation/{like['testbed']}/" in file]
        assert own.count(like["evidence"]) == 1, like["evidence"]
