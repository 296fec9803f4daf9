"""The front page: a loop, the pipeline, a table of findings and a card per testbed.

Its texts are in a YAML file, `FrontPage`. Numbers come from the `claims.csv` of the testbeds' reports: an
entry names a claim, and its text refers to cases, `{Turn}`, or to `{value}` if there are none.
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from dissertation.evidence.claims import VERDICTS, combined
from dissertation.evidence.judged_page import TEMPLATES
from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, read_values
from structlearn.reporting.document import Provenance, environment
from structlearn.reporting.evidence import NOT_TESTED

RECORDED = "recorded"
"""Folder of the report on recorded data; machines without the data use the claims in `claims.QUOTED`."""


class Row(Parameters):
    """A claim of a report, and its numbers as text."""

    report: str  # folder of the report
    claim: str  # its `evidence` in the report's claims
    words: str  # a template that refers to numbers by case, without their intervals
    set: str = ""  # data set, if several have a claim of that name
    cases: tuple[str, ...] = ()  # all if empty


class Finding(Parameters):
    """A question, with its published, simulated and recorded answers."""

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
    pages: Mapping[str, str] = {}  # titles of further pages, by file name


class Step(Parameters):
    """A box in the diagram of the pipeline."""

    name: str
    stage: str  # in dvc.yaml, that makes it
    page: str  # that shows it
    path: str  # drawing in the box: an SVG path, 100 wide and 44 high


class FrontPage(Parameters):
    """Contents of the file with the front page's texts."""

    steps: tuple[Step, ...]
    findings: tuple[Finding, ...]
    cards: Mapping[str, Card]  # by folder of the report, in page order


def read_front_page(path: Path) -> FrontPage:
    """Read the front page's texts.

    Raises InputError: there is no such file, or it is no YAML; ValueError: it has an unknown key.
    """
    return FrontPage(**read_values(path))


def render_front(
    page: FrontPage, claims: Mapping[str, pd.DataFrame], tasks: Mapping[str, str], made: Provenance
) -> str:
    """Render the front page to HTML.

    `claims`: `claims_table` by report; `tasks`: pages of single tasks by name. Raises InputError: a report
    lacks a claim or case that the page uses.
    """
    counts = {report: _counts(table) for report, table in claims.items()}
    tiles = {name: [answer(tile, claims) for tile in card.tiles] for name, card in page.cards.items()}
    template = environment(TEMPLATES).get_template("front.html.jinja")
    return template.render(
        page=page,
        findings=[(one, *_answers(one, claims)) for one in page.findings],
        tiles=tiles,
        counts=counts,
        totals={word: sum(its[word] for its in counts.values()) for word in VERDICTS},
        vocabulary=VERDICTS,
        tasks=tasks,
        made=made,
    )


def findings_table(page: FrontPage, claims: Mapping[str, pd.DataFrame]) -> str:
    """Findings as a Markdown table, for the README."""
    lines = ["| question | published | simulated | recorded |", "|---|---|---|---|"]
    for one in page.findings:
        told = [f"{words} (**{verdict}**)" if words else "" for words, verdict in _answers(one, claims)]
        lines.append(f"| {one.question} | {one.published} | {told[0]} | {told[1]} |")
    return "\n".join(lines) + "\n"


def _answers(one: Finding, claims: Mapping[str, pd.DataFrame]) -> list[tuple[str, str]]:
    """Text and verdict, simulated and recorded; empty if there is none."""
    return [answer(row, claims) if row else ("", "") for row in (one.simulated, one.recorded)]


def answer(row: Row, claims: Mapping[str, pd.DataFrame]) -> tuple[str, str]:
    """Text of a row with its numbers, and its verdict. Raises InputError: the claim or case is missing."""
    table = claims[row.report]
    where = f"{row.report}: claim {row.claim}{f' of {row.set}' if row.set else ''}"
    found = table[table["evidence"] == row.claim]
    if row.set:
        found = found[found["set"] == row.set]
    if row.cases:
        found = found[found["case"].isin(row.cases)]
    if found.empty and row.report == RECORDED:
        return "not recorded here", NOT_TESTED  # a machine may have only some of the data sets
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
    """Number of the dissertation's statements with each verdict."""
    its = table[table["by"] == "published"]
    its = its.drop_duplicates([name for name in ("set", "evidence") if name in table])
    return {word: int((its["verdict_of_all"] == word).sum()) for word in VERDICTS}
