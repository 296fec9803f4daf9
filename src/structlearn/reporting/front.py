"""The front page: a card per testbed, from its own `card.yaml` and the numbers that its report wrote."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from jinja2 import UndefinedError
from pydantic import BaseModel, ConfigDict

from structlearn.core.artefacts import Metrics, read_metrics
from structlearn.core.params import read_values
from structlearn.reporting.claims import VERDICTS
from structlearn.reporting.document import environment
from structlearn.reporting.findings import read_findings, values_by_key

KIT = "structlearn.reporting"


class Number(BaseModel):
    """A number of a card: what it is, what the dissertation prints, and what is found here."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    label: str
    published: str
    here: str


class Card(BaseModel):
    """What the front page says about one testbed; all texts are templates that may name its metrics.

    Attributes:
        title: of the testbed.
        sentence: what it is about.
        section: of the dissertation.
        picture: path relative to its report.
        alt: what a reader hears who cannot see the picture.
        simulated: what of it is simulated, in words behind that word.
        numbers: two or three.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    sentence: str
    section: str
    picture: str
    alt: str
    simulated: str
    numbers: list[Number]


@dataclass(frozen=True)
class Report:
    """One testbed's report as the front page needs it.

    Attributes:
        folder: beside the front page.
        card: see there, its texts not yet rendered.
        metrics: its headline figures and all other findings by key.
        pages: further pages of it, title by file name.
    """

    folder: str
    card: Card
    metrics: Metrics
    pages: Mapping[str, str]

    @property
    def verdicts(self) -> dict[str, int]:
        """How many statements of the dissertation have each verdict."""
        keys = {word: f"claims_{word.replace(' ', '_')}" for word in VERDICTS}
        return {word: int(self.metrics.get(key) or 0) for word, key in keys.items()}


def read_report(folder: Path, card: Path, pages: Mapping[str, str] | None = None) -> Report:
    """Read what a testbed's report left in its folder.

    Args:
        folder: with `metrics.json` and `findings.csv`.
        card: the testbed's `card.yaml`.
        pages: further pages, title by file name.

    Raises:
        InputError: a file is missing or not readable.
    """
    findings = values_by_key(read_findings(folder / "findings.csv"))
    metrics = {**findings, **read_metrics(folder / "metrics.json")}
    described = Card(**read_values(card))
    return Report(folder.name, described, metrics, pages or {})


def render_front(reports: Sequence[Report]) -> str:
    """The front page as HTML; a card's texts name metrics of its own testbed."""
    made = environment(KIT)
    rendered = [(one, _rendered_card(one)) for one in reports]
    totals = {word: sum(one.verdicts[word] for one in reports) for word in VERDICTS}
    return made.get_template("front.html.jinja").render(reports=rendered, totals=totals, vocabulary=VERDICTS)


def _rendered_card(report: Report) -> dict[str, object]:
    """The card's texts; a number of what was not run, which has no metric then, is left out."""
    texts = {
        name: _rendered(text, report.metrics)
        for name, text in report.card.model_dump(exclude={"numbers"}).items()
    }
    numbers = []
    for number in report.card.numbers:
        with suppress(UndefinedError):
            numbers.append(
                {name: _rendered(text, report.metrics) for name, text in number.model_dump().items()}
            )
    return texts | {"numbers": numbers}


def _rendered(text: str, metrics: Metrics) -> str:
    return environment(KIT).overlay(autoescape=False).from_string(text).render(metrics)
