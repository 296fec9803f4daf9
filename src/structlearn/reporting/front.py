"""Front page: a loop, the pipeline, a table of findings, and a card per testbed.

Its text is in a YAML file, `FrontPage`. Numbers come from `claims.csv` of a testbed's report: an entry gives
the claim, and its text names the cases, `{Turn}`, or `{value}` if there are none.
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, read_values
from structlearn.reporting.claims import NOT_TESTED, VERDICTS, combined
from structlearn.reporting.document import Made, environment

RECORDED = "recorded"
"""Folder of the report on recorded data; its claims are in `claims.QUOTED` too, for machines without data."""


class Row(Parameters):
    """A claim of a report, with a text for its numbers."""

    report: str  # folder of the report
    claim: str  # its name, `evidence` in the report's claims
    words: str  # a template with numbers by case, without their intervals
    set: str = ""  # of recorded data, if several have a claim of that name
    cases: tuple[str, ...] = ()  # default: all


class Finding(Parameters):
    """A question, and what was published, simulated and recorded about it."""

    question: str
    published: str
    simulated: Row | None = None
    recorded: Row | None = None


class Card(Parameters):
    """A testbed on the front page."""

    title: str
    sentence: str
    section: str  # of the dissertation
    picture: str  # path relative to its report
    alt: str  # description of the picture
    simulated: str  # what is simulated
    tiles: tuple[Row, ...]  # one number each, up to `|`
    pages: Mapping[str, str] = {}  # further pages of it, title by file name


class Step(Parameters):
    """A box of the drawing of the pipeline."""

    name: str
    stage: str  # stage of dvc.yaml
    page: str  # page that shows it
    path: str  # icon in the box: an SVG path, 100 wide and 44 high


class FrontPage(Parameters):
    """Contents of the file with the front page's text."""

    steps: tuple[Step, ...]
    findings: tuple[Finding, ...]
    cards: Mapping[str, Card]  # by folder of the report, in the order of the page


def read_front_page(path: Path) -> FrontPage:
    """Read the file. Raises InputError: missing or no YAML; ValueError: an unknown key."""
    return FrontPage(**read_values(path))


def render_front(
    page: FrontPage, claims: Mapping[str, pd.DataFrame], tasks: Mapping[str, str], made: Made
) -> str:
    """The front page as HTML. Raises InputError: a report lacks a claim or case that the page names.

    `claims`: `claims_table` by report; `tasks`: pages of single tasks by name.
    """
    counts = {report: _counts(table) for report, table in claims.items()}
    tiles = {name: [in_words(tile, claims) for tile in card.tiles] for name, card in page.cards.items()}
    template = environment("structlearn.reporting").get_template("front.html.jinja")
    return template.render(
        page=page,
        findings=[(one, *_told(one, claims)) for one in page.findings],
        tiles=tiles,
        counts=counts,
        totals={word: sum(its[word] for its in counts.values()) for word in VERDICTS},
        vocabulary=VERDICTS,
        tasks=tasks,
        made=made,
    )


def findings_table(page: FrontPage, claims: Mapping[str, pd.DataFrame]) -> str:
    """The table of findings in Markdown, for the README."""
    lines = ["| question | published | simulated | recorded |", "|---|---|---|---|"]
    for one in page.findings:
        told = [f"{words} (**{verdict}**)" if words else "" for words, verdict in _told(one, claims)]
        lines.append(f"| {one.question} | {one.published} | {told[0]} | {told[1]} |")
    return "\n".join(lines) + "\n"


def _told(one: Finding, claims: Mapping[str, pd.DataFrame]) -> list[tuple[str, str]]:
    """(text, verdict) for simulated and recorded data; empty if there is none."""
    return [in_words(row, claims) if row else ("", "") for row in (one.simulated, one.recorded)]


def in_words(row: Row, claims: Mapping[str, pd.DataFrame]) -> tuple[str, str]:
    """Text with numbers, and verdict, of a row. Raises InputError: there is no such claim or case."""
    table = claims[row.report]
    where = f"{row.report}: claim {row.claim}{f' of {row.set}' if row.set else ''}"
    found = table[table["evidence"] == row.claim]
    if row.set:
        found = found[found["set"] == row.set]
    if row.cases:
        found = found[found["case"].isin(row.cases)]
    if found.empty and row.report == RECORDED:
        return "not recorded here", NOT_TESTED  # a machine may have only some of the sets
    if found.empty:
        raise InputError(f"{where}: the front page names it, and there is none")
    numbers = {
        case or "value": here.split(" [")[0] for case, here in zip(found["case"], found["here"], strict=True)
    }
    verdict = combined(list(found["verdict"]))
    if verdict == NOT_TESTED:
        return next(iter(numbers.values())), verdict
    try:
        return row.words.format_map(numbers), verdict
    except KeyError as error:
        raise InputError(f"{where}: has no case {error}; there are {sorted(numbers)}") from error


def read_claims_of(report: str, folder: Path) -> pd.DataFrame:
    """Read a report's `claims.csv`. Raises InputError: it is missing or lacks the names of claims."""
    path = folder / "claims.csv"
    table = read_csv(path, keep_default_na=False)
    if "evidence" not in table:
        raise InputError(f"{path}: has no names of claims; make the report of {report} again")
    return table


def _counts(table: pd.DataFrame) -> dict[str, int]:
    """Number of statements of the dissertation with each verdict."""
    its = table[table["by"] == "published"]
    its = its.drop_duplicates([name for name in ("set", "evidence") if name in table])
    return {word: int((its["verdict_of_all"] == word).sum()) for word in VERDICTS}
