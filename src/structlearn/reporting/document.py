"""Pages are documents: a template holds the sentences, Python supplies figures, tables, claims and numbers.

In a template stand `{% call section("Heading") %}`, `{{ figure("name", "Caption.", "what one sees") }}`,
`{{ table("name", "Caption.") }}`, numbers such as `{{ error | f(".2f") }}`,
`{{ recording("name", "what it shows") }}`, `{% call fold("Further tables") %}` and more: see `Scribe`.
`document.html.jinja` has the blocks that a template fills: title, opening, sections, folded.

A page needs no network and no script; its figures, tables and recordings lie beside it. Equal contents of one
commit give equal bytes: no wall times, and of dates only that of the data.
"""

import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from structlearn.core.params import Parameters
from structlearn.reporting import prose
from structlearn.reporting.claims import VERDICTS, Judged, OnRecordings, in_sentence, verdict_counts

MISSING = "\N{EN DASH}"
UNKNOWN_COMMIT = "unknown commit"


@dataclass(frozen=True)
class Table:
    """A table of a data frame, without its index; it is written as `tables/NAME.csv` too."""

    frame: pd.DataFrame  # the rows, in order
    # by column, how a number is written, e.g. `.1f`; other numbers are written as they are
    formats: Mapping[str, str] = field(default_factory=dict)
    # by column, what is written above it; default the column's name
    headings: Mapping[str, str] = field(default_factory=dict)
    strong: frozenset[int] = frozenset()  # row positions that are set in bold
    # by column, what is written for a value, such as a model's name for its key
    words: Mapping[str, Mapping[Any, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """Where the numbers of a figure or a table come from: a file, and the stage that makes it."""

    path: str
    stage: str


@dataclass(frozen=True)
class Panel:
    """One picture of a figure: its path relative to the page, and its size in pixels."""

    path: str
    width: int
    height: int


@dataclass(frozen=True)
class Document:
    """Contents of a page."""

    template: str  # its file in `package`
    package: str  # of the testbed's page, e.g. `structlearn.testbeds.obstacles.page`
    stage: str = ""  # that draws it; pages without figures and tables of their own need none
    facts: Mapping[str, object] = field(default_factory=dict)  # what its sentences name
    tables: Mapping[str, Table] = field(default_factory=dict)  # by name
    judged: Sequence[Judged] = ()  # claims with their verdicts
    # by name, for `source=` of figures and tables
    sources: Mapping[str, Source] = field(default_factory=dict)
    # by their key in `params.yaml`; listed in the end
    parameters: Mapping[str, Parameters] = field(default_factory=dict)
    recordings: str = ""  # folder of the .rrd files, relative to the page
    simulated: bool = False  # whether what it shows was simulated; it is labelled so
    recorded: Sequence[OnRecordings] = ()  # which of its statements were tested on recorded data too
    # what the verdicts rest on beside the pipeline: a sentence, and one that is hidden at first
    basis: tuple[str, str] = ("", "")
    root: str = ".."  # folder of the front page, relative to this one
    command: str = ""  # that makes it; default `dvc repro STAGE`


@dataclass(frozen=True)
class Made:
    """From what and how a page was made, as its footer says."""

    commit: str
    date: str = ""  # of the youngest data, `2026-11-23`
    command: str = ""


class Scribe:
    """Functions that a template may call, for one page.

    `section` and `fold` take their content as a call block; a caption may be one too. Headings, figures and
    tables get anchors; what is asked for and does not exist is an error.
    """

    def __init__(self, document: Document, figures: Mapping[str, Sequence[Panel]]) -> None:
        self._document = document
        self._figures = figures
        self._parts: Any = environment(document.package).get_template("parts.html.jinja").module
        self.contents: list[tuple[str, str]] = []

    def section(self, heading: str, caller: Callable[[], Markup]) -> Markup:
        """A section with an entry in the list of contents."""
        self.contents.append((anchor(heading), heading))
        return self._parts.section(anchor(heading), heading, caller())

    def fold(self, heading: str, caller: Callable[[], Markup]) -> Markup:
        """A part that is hidden until the reader opens it."""
        return self._parts.fold(anchor(heading), heading, caller())

    def figure(
        self,
        name: str,
        caption: str = "",
        alt: str = "",
        source: str = "",
        caller: Callable[[], Markup] | None = None,
    ) -> Markup:
        """A figure of one or more panels, which stand beside each other where there is room.

        `source`: name of one of the document's sources, or names with spaces between them.
        """
        caption = caller() if caller is not None else caption
        return self._parts.figure(
            name, self._figures[name], caption, alt, self._sources(source), self._document.stage
        )

    def table(
        self,
        name: str,
        caption: str = "",
        source: str = "",
        folded: bool = False,
        caller: Callable[[], Markup] | None = None,
    ) -> Markup:
        """A table with a link to its CSV file; `folded` hides it until the reader opens it."""
        caption = caller() if caller is not None else caption
        shown = self._document.tables[name]
        return self._parts.table(name, shown, caption, self._sources(source), self._document.stage, folded)

    def verdicts(self) -> Markup:
        """The table of verdicts, with its counts above; by sets of data where there are several."""
        judged = self._document.judged
        counts = {by: verdict_counts(judged, by) for by in ("text", "ours")}
        several = any(one.heading for one in judged)
        return (self._parts.verdicts_by_set if several else self._parts.verdicts)(judged, counts, VERDICTS)

    def on_recordings(self) -> Markup:
        """The table of statements that were tested on recorded data too."""
        return self._parts.on_recordings(self._document.recorded)

    def recording(self, name: str, note: str) -> Markup:
        """A link to a recording, with what it shows."""
        return self._parts.recording(f"{self._document.recordings}/{name}.rrd", name, note)

    def parameters(self) -> Markup:
        """The parameters that the page's results were made with."""
        return self._parts.rows(parameter_table(self._document.parameters))

    def footer(self) -> Markup:
        """Links to the other pages, and from what this one was made."""
        document = self._document
        paths = [Path(source.path) for source in document.sources.values()]
        command = document.command or (f"dvc repro {document.stage}" if document.stage else "")
        return self._parts.footer(document.root, Made(source_commit(), date_of(paths), command))

    def _sources(self, names: str) -> list[Source]:
        return [self._document.sources[name] for name in names.split()]


def render(document: Document, figures: Mapping[str, Sequence[Panel]]) -> str:
    """The page as HTML.

    The template is rendered twice: the list of contents stands before the sections that are in it.

    Raises:
        jinja2.UndefinedError: the template names a value that is not there.
        KeyError: it names a figure, table or source that is not there.
    """
    template = environment(document.package).get_template(document.template)
    scribe = Scribe(document, figures)
    given = {name: getattr(scribe, name) for name in dir(Scribe) if not name.startswith("_")}
    given |= {"document": document, **document.facts}
    template.render(given, contents=[])
    contents = scribe.contents.copy()
    return template.render(given, contents=contents)


@lru_cache
def environment(package: str) -> Environment:
    """Templates of a testbed's page and of this kit; everything is escaped, nothing may be undefined."""
    made = Environment(
        loader=ChoiceLoader([PackageLoader(package, ""), PackageLoader("structlearn.reporting")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["f"] = lambda value, digits: prose.rounded(value + 0, digits)  # + 0: nothing undefined
    made.filters["words"] = in_sentence
    for filter_ in (prose.listing, prose.counted, prose.capitalised, cell, anchor):
        made.filters[filter_.__name__] = filter_
    for function in (prose.interval, prose.with_interval, prose.with_spread, prose.percent):
        made.globals[function.__name__] = function
    made.tests["numeric"] = is_numeric
    return made


def date_of(paths: Iterable[Path]) -> str:
    """Day on which the youngest of the files was written, `2026-11-23`; empty if there is none."""
    times = [
        file.stat().st_mtime
        for path in paths
        for file in (path.rglob("*") if path.is_dir() else [path])
        if file.is_file()
    ]
    return f"{datetime.fromtimestamp(max(times), UTC):%Y-%m-%d}" if times else ""


def source_commit(folders: Iterable[str] = ("src", "stages"), root: Path = Path(".")) -> str:
    """`b9b799a`, or `b9b799a+changes` where folders are not as committed; DVC's locks do not count.

    `UNKNOWN_COMMIT` where the project was unpacked from an archive, or git is missing.
    """

    def git(*arguments: str) -> str | None:
        """Output of git; None if it fails."""
        try:
            done = subprocess.run(
                ["git", "-C", root, *arguments], capture_output=True, text=True, check=False
            )
        except OSError:
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    commit = git("rev-parse", "--short", "HEAD")
    if not commit or git("rev-parse", "--show-prefix") != "":  # of another project around this one
        return UNKNOWN_COMMIT
    changed = git("status", "--porcelain", "--", *folders, ":(exclude)*.lock")
    return f"{commit}+changes" if changed else commit


def anchor(heading: str) -> str:
    """Name of a heading in the page's address: letters and digits, dashes between words."""
    words = "".join(letter if letter.isalnum() else " " for letter in heading.lower())
    return "-".join(words.split())


def words_in_view(page: str) -> int:
    """Words of a page that a reader sees before opening a fold."""
    for hidden in ("style", "script", "head"):
        page = re.sub(rf"<{hidden}\b.*?</{hidden}>", " ", page, flags=re.DOTALL)
    innermost = re.compile(r"<details\b(?:(?!<details\b).)*?</details>", re.DOTALL)
    while innermost.search(page):  # folds stand in folds
        page = innermost.sub(" ", page)
    return len(re.sub(r"<[^>]*>", " ", page).split())


def is_numeric(column: pd.Series) -> bool:
    """Whether a column is set flush right."""
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def cell(value: object, number_format: str = "") -> str:
    """Text of a table's cell: yes or no, a number with a true minus sign, a dash where there is nothing."""
    if value is None or (isinstance(value, float | np.floating) and not np.isfinite(value)):
        return MISSING
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | float | np.number):
        if isinstance(value, float | np.floating):
            number_format = number_format or ".6g"  # digits beyond depend on the processor
        return format(value, number_format).replace("-", "\N{MINUS SIGN}")
    return str(value)


def parameter_table(parameters: Mapping[str, Parameters]) -> pd.DataFrame:
    """One row per parameter of every key of `params.yaml`, named as for `dvc exp run --temp -S`."""
    rows = [row for key, model in parameters.items() for row in _rows(key, model.model_dump(mode="json"))]
    return pd.DataFrame(rows, columns=["parameter", "value"])


def _rows(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Dotted name and value of every leaf; lists of plain values are one leaf, as are named entries."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _rows(f"{key}.{name}", inner)
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for place, inner in enumerate(value):
            yield f"{key}.{place}", ", ".join(f"{name} {_text(leaf)}" for name, leaf in inner.items())
    else:
        yield key, _text(value)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_text(inner) for inner in value) or MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return MISSING
    return f"{value:g}" if isinstance(value, float) else str(value)
