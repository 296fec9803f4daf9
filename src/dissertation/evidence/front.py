"""The front page: a forest plot, the dissertation's experiments by chapter, our aims, a card per testbed.

Its texts are in a YAML file, `FrontPage`. Numbers, intervals and verdicts come from the `claims.csv` of the
reports, by the name of a claim (its `evidence`); of recorded data, all sets that have a claim of that name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from pydantic import model_validator

from dissertation.evidence.claims import VERDICTS, combined
from dissertation.evidence.forest_figures import RECORDED, SIMULATED, Mark, Strip
from dissertation.evidence.judged_page import TEMPLATES
from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, read_values
from structlearn.reporting.document import Panel, Provenance, anchor, environment
from structlearn.reporting.evidence import NOT_TESTED

ABOVE = {"above": 1, "at least": 1, "below": -1, "at most": -1}  # side of the bound on which a test holds


class Row(Parameters):
    """A claim of a report."""

    report: str  # folder of the report
    claim: str  # its `evidence` in the report's claims
    set: str = ""  # data set, if several have a claim of that name
    cases: tuple[str, ...] = ()  # all if empty


class Tile(Row):
    """A number on a card."""

    words: str  # after the number


class Experiment(Parameters):
    """An experiment of the dissertation, or an aim of this project."""

    question: str
    text: str = ""  # the text's experiment: robot, n, figure or table
    published: str = ""  # its result
    printed: tuple[float, ...] = ()  # that result in the unit of the simulated claim, for the forest plot
    here: str = ""  # what replaces it in simulation
    simulated: Row | None = None
    recorded: tuple[str, ...] = ()  # claims about recorded data, in every set that has them
    differs: str = ""  # what else differs


class Place(Parameters):
    """Where a figure or table of the dissertation is found here."""

    what: str  # e.g. `figure IV.16`
    shows: str
    page: str = ""  # with its anchor, relative to the front page; empty if it is missing
    result: Literal["same", "weaker", "other data", "missing"]
    why: str = ""  # needed unless it is the same

    @model_validator(mode="after")
    def _is_explained(self) -> "Place":
        if self.result != "same" and not self.why:
            raise ValueError(f"{self.what}: say why it is {self.result}")
        if bool(self.page) == (self.result == "missing"):
            raise ValueError(f"{self.what}: needs a page unless it is missing")
        return self


class Card(Parameters):
    """A testbed on the front page."""

    title: str
    sentence: str
    section: str  # of the dissertation
    picture: str  # path relative to its report
    alt: str  # description of the picture
    simulated: str  # what is simulated
    tiles: tuple[Tile, ...]
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
    chapters: Mapping[str, tuple[Experiment, ...]]  # by title
    aims: tuple[Experiment, ...]
    rivals: tuple[Experiment, ...]  # against policies without structure
    index: tuple[Place, ...]
    cards: Mapping[str, Card]  # by folder of the report, in page order

    @property
    def experiments(self) -> list[Experiment]:
        """All experiments and aims, in page order."""
        return [*(one for its in self.chapters.values() for one in its), *self.aims, *self.rivals]

    @property
    def reports(self) -> list[str]:
        """Folders of all reports whose claims the page needs, each once."""
        rows = [one.simulated for one in self.experiments if one.simulated]
        return list(dict.fromkeys([*self.cards, *(row.report for row in rows)]))


@dataclass(frozen=True)
class Answer:
    """What came out for a claim, in simulation or in one data set."""

    heading: str  # data set; empty in simulation
    statement: str
    cases: tuple[tuple[str, str, str], ...]  # case, number with its interval, verdict
    n: str
    verdict: str
    link: str  # to the row

    @property
    def deciding(self) -> str:
        """The first case with the verdict, and of how many it is one."""
        case, here, _ = next(one for one in self.cases if one[-1] == self.verdict)
        more = f" (one of {len(self.cases)} cases)" if len(self.cases) > 1 else ""
        return f"{case + ': ' if case else ''}{here}{more}"


def read_front_page(path: Path) -> FrontPage:
    """Read the front page's texts.

    Raises InputError: there is no such file, or it is no YAML; ValueError: it has an unknown key.
    """
    return FrontPage(**read_values(path))


def render_front(
    page: FrontPage,
    claims: Mapping[str, pd.DataFrame],
    tasks: Mapping[str, str],
    forest: Sequence[Panel],
    made: Provenance,
) -> str:
    """Render the front page to HTML.

    `claims`: `claims_table` by report; `tasks`: pages of single tasks by name. Raises InputError: a report
    lacks a claim that the page uses.
    """
    counts = {report: _counts(table) for report, table in claims.items()}
    template = environment(TEMPLATES).get_template("front.html.jinja")
    return template.render(
        page=page,
        simulated={one.question: answers_of(one, claims) for one in page.experiments},
        recorded={one.question: recorded_answers(one, claims["recorded"]) for one in page.experiments},
        tiles={name: [tile(one, claims) for one in card.tiles] for name, card in page.cards.items()},
        counts=counts,
        totals=_counts(pd.concat(list(claims.values()))),
        of_all=lambda answers, rows: [answer for one in rows for answer in answers[one.question]],
        vocabulary=VERDICTS,
        tasks=tasks,
        forest=forest,
        made=made,
    )


def findings_table(page: FrontPage, claims: Mapping[str, pd.DataFrame]) -> str:
    """The dissertation's experiments with their verdicts as a Markdown table, for the README."""
    lines = ["| question | simulated | recorded |", "|---|---|---|"]
    for one in (one for its in page.chapters.values() for one in its):
        cells = (answers_of(one, claims), recorded_answers(one, claims["recorded"]))
        words = [", ".join(answer.verdict for answer in answers) for answers in cells]
        lines.append(f"| {one.question} | {words[0]} | {words[1]} |")
    return "\n".join(lines) + "\n"


def answers_of(one: Experiment, claims: Mapping[str, pd.DataFrame]) -> list[Answer]:
    """Answer of the simulated claim, if there is any. Raises InputError: the report lacks it."""
    if one.simulated is None:
        return []
    row = one.simulated
    rows = rows_of(row, claims)
    link = f"{row.report}/{rows['page'].iloc[0]}.html#{row.claim}"
    return [_answer("", rows, link)]


def recorded_answers(one: Experiment, table: pd.DataFrame) -> list[Answer]:
    """Answers of all data sets that were run and have one of the claims, in the order of the claims."""
    return [
        _answer(str(heading), rows, f"recorded/index.html#{anchor(str(heading))}-{claim}")
        for claim in one.recorded
        for heading, rows in table[table["evidence"] == claim].groupby("set", sort=False)
        if (rows["verdict"] != NOT_TESTED).any()
    ]


def _answer(heading: str, rows: pd.DataFrame, link: str) -> Answer:
    cases = tuple(rows[["case", "here", "verdict"]].itertuples(index=False, name=None))
    n = ", ".join(dict.fromkeys(str(count) for count in rows["n"]))
    return Answer(heading, rows["statement"].iloc[0], cases, n, combined(list(rows["verdict"])), link)


def rows_of(row: Row, claims: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Rows of a claim in its report's table. Raises InputError: there are none, unless of recorded data."""
    table = claims[row.report]
    found = table[table["evidence"] == row.claim]
    if row.set:
        found = found[found["set"] == row.set]
    if row.cases:
        found = found[found["case"].isin(row.cases)]
    if found.empty and row.report != "recorded":  # a machine may have only some of the data sets
        cases = f" with the cases {', '.join(row.cases)}" if row.cases else ""
        raise InputError(
            f"{row.report}: claim {row.claim}{cases}: the front page names it, and there is none"
        )
    return found


def tile(one: Tile, claims: Mapping[str, pd.DataFrame]) -> tuple[str, str]:
    """A number of a card and the words after it."""
    found = rows_of(one, claims)
    return (str(found["number"].iloc[0]) if len(found) else "not recorded here"), one.words


def forest_strips(page: FrontPage, claims: Mapping[str, pd.DataFrame]) -> list[Strip]:
    """Strips of the forest plot: each of the dissertation's experiments, simulated and recorded.

    Numbers in one unit with one bound are on one strip; cases with other bounds have strips of their own.
    """
    table, strips = claims["recorded"], []
    for one in (one for its in page.chapters.values() for one in its):
        own: list[Strip] = []
        if one.simulated:
            own += _strips(SIMULATED, one.question, SIMULATED, rows_of(one.simulated, claims), one.printed)
        for claim in one.recorded:
            for heading, rows in table[table["evidence"] == claim].groupby("set", sort=False):
                for strip in _strips(RECORDED, one.question, str(heading), rows):
                    place = next((place for place, other in enumerate(own) if _alike(other, strip)), None)
                    if place is None:
                        own.append(strip)
                    else:
                        own[place] = _joined(own[place], strip)
        strips += own
    return strips


def _alike(one: Strip, other: Strip) -> bool:
    return (one.unit, one.bounds, one.side) == (other.unit, other.bounds, other.side)


def _joined(one: Strip, other: Strip) -> Strip:
    labels = tuple(dict.fromkeys((*one.labels, *other.labels)))
    return replace(one, labels=labels, marks=[*one.marks, *other.marks])


def _strips(
    where: str, question: str, label: str, rows: pd.DataFrame, printed: Sequence[float] = ()
) -> list[Strip]:
    """A claim's cases with finite numbers, one strip per bound."""
    values = pd.to_numeric(rows["value"], errors="coerce")
    rows, strips = rows[np.isfinite(values) & (rows["test"] != "zero")], []
    for bound, its in rows.groupby("bound", sort=False):
        bounds = tuple(float(end) for end in str(bound).split())
        ends = its[["value", "low", "high"]].apply(pd.to_numeric, errors="coerce")
        ends = ends.fillna({"low": -np.inf, "high": np.inf})  # of one sample
        marks = [Mark(where, *row) for row in ends.to_numpy(float)]
        words = label if len(its) == len(rows) else f"{label}, {', '.join(its['case']).lower()}"
        side = ABOVE.get(str(its["test"].iloc[0]), 0)
        unit = str(its["unit"].iloc[0])
        strips.append(Strip(question, (words,), unit, marks, bounds, side, tuple(printed)))
    return strips


def read_claims_of(report: str, folder: Path) -> pd.DataFrame:
    """Read a report's `claims.csv`. Raises InputError: it is missing or lacks numbers of claims."""
    path = folder / "claims.csv"
    table = read_csv(path, keep_default_na=False)
    if "number" not in table:
        raise InputError(f"{path}: has no numbers of claims; make the report of {report} again")
    return table


def _counts(table: pd.DataFrame) -> dict[str, int]:
    """Number of distinct statements of the dissertation with each verdict, the worst of several data."""
    its = table[table["by"] == "published"]
    worst = its.groupby("statement", sort=False)["verdict_of_all"].agg(lambda words: combined(list(words)))
    return {word: int((worst == word).sum()) for word in VERDICTS}
