"""Pages as documents: templates hold the sentences; Python supplies figures, tables and numbers.

Templates call `{% call section("Heading") %}`, `{{ figure("name", "Caption.", "what one sees") }}`,
`{{ table("name", "Caption.") }}`, numbers such as `{{ error | f(".2f") }}`,
`{{ recording("name", "what it shows") }}`, `{% call fold("Further tables") %}` and more: see `PageHelpers`.
`document.html.jinja` has the blocks that a template fills: title, opening, sections, folded.
A project with more to say on every page extends `Document`, `PageHelpers` and that template.

A page needs no network and no script; its figures, tables and recordings are files beside it. Equal contents
from the same sources give equal bytes: there are no wall times and no dates.
"""

import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, PrefixLoader, StrictUndefined
from markupsafe import Markup

from structlearn.core.params import Parameters
from structlearn.reporting import prose
from structlearn.reporting.evidence import in_words

MISSING = "\N{EN DASH}"
UNKNOWN_COMMIT = "unknown commit"


@dataclass(frozen=True)
class Table:
    """A data frame shown on a page without its index, and written to `tables/NAME.csv`."""

    frame: pd.DataFrame
    formats: Mapping[str, str] = field(default_factory=dict)  # number formats by column, e.g. `.1f`
    headings: Mapping[str, str] = field(default_factory=dict)  # by column; default the column's name
    strong: frozenset[int] = frozenset()  # indices of bold rows
    words: Mapping[str, Mapping[Any, str]] = field(default_factory=dict)  # texts for values, by column


@dataclass(frozen=True)
class Source:
    """File with the numbers of a figure or table, and the stage that writes it."""

    path: str
    stage: str


@dataclass(frozen=True)
class Panel:
    """One image of a figure: path relative to the page, and size in pixels."""

    path: str
    width: int
    height: int
    drawn: bool = True  # by a plot, whose colours a dark page inverts; otherwise an image of a scene


@dataclass(frozen=True)
class Document:
    """Contents of a page."""

    template: str  # file name in `package`
    package: str  # of the testbed's page, e.g. `dissertation.obstacles.page`
    stage: str = ""  # that makes its figures and tables
    facts: Mapping[str, object] = field(default_factory=dict)  # values for the template's sentences
    tables: Mapping[str, Table] = field(default_factory=dict)
    sources: Mapping[str, Source] = field(default_factory=dict)  # for `source=` of figures and tables
    parameters: Mapping[str, Parameters] = field(default_factory=dict)  # keyed as in `params.yaml`
    recordings: str = ""  # folder of the .rrd files, relative to the page
    simulated: bool = False  # whether to label it as simulated
    clone: str = "."  # folder of the sources, whose commit the footer names
    command: str = ""  # that makes the page; default `dvc repro STAGE`

    @property
    def shown_by(self) -> str:
        """Command that makes its figures and tables."""
        return f"dvc repro {self.stage}" if self.stage else self.command

    def environment(self) -> Environment:
        """Jinja environment of the page's templates."""
        return environment(self.package)

    def helpers(self, figures: Mapping[str, Sequence[Panel]]) -> "PageHelpers":
        """Functions for the page's templates."""
        return PageHelpers(self, figures)


@dataclass(frozen=True)
class Provenance:
    """Provenance of a page, for its footer."""

    commit: str
    command: str = ""


class PageHelpers:
    """Functions for page templates; unknown figures, tables and sources are errors.

    `section` and `fold` take their content as a call block; captions may be call blocks too.
    """

    def __init__(self, document: Document, figures: Mapping[str, Sequence[Panel]]) -> None:
        self._document = document
        self._figures = figures
        self._parts: Any = document.environment().get_template("parts.html.jinja").module
        self.contents: list[tuple[str, str]] = []

    def section(self, heading: str, caller: Callable[[], Markup]) -> Markup:
        """Section with an entry in the table of contents."""
        self.contents.append((anchor(heading), heading))
        return self._parts.section(anchor(heading), heading, caller())

    def fold(self, heading: str, caller: Callable[[], Markup]) -> Markup:
        """Part that is hidden until the reader opens it."""
        return self._parts.fold(anchor(heading), heading, caller())

    def figure(
        self,
        name: str,
        caption: str = "",
        alt: str = "",
        source: str = "",
        caller: Callable[[], Markup] | None = None,
    ) -> Markup:
        """Figure of one or more panels; `source`: space-separated names of the document's sources."""
        caption = caller() if caller is not None else caption
        panels, sources = self._figures[name], self._sources(source)
        return self._parts.figure(name, panels, caption, alt, sources, self._document.shown_by)

    def table(
        self,
        name: str,
        caption: str = "",
        source: str = "",
        folded: bool = False,
        caller: Callable[[], Markup] | None = None,
    ) -> Markup:
        """Table with a link to its CSV file; `folded` hides it until the reader opens it."""
        caption = caller() if caller is not None else caption
        shown = self._document.tables[name]
        return self._parts.table(name, shown, caption, self._sources(source), self._document.shown_by, folded)

    def recording(self, name: str, note: str) -> Markup:
        """Link to a recording, with a note on its contents."""
        return self._parts.recording(f"{self._document.recordings}/{name}.rrd", name, note)

    def parameters(self) -> Markup:
        """Table of the parameters behind the page's results."""
        return self._parts.rows(parameter_table(self._document.parameters))

    def footer(self) -> Markup:
        """This page's provenance."""
        return self._parts.footer(self._provenance())

    def _provenance(self) -> Provenance:
        document = self._document
        return Provenance(source_commit(root=Path(document.clone)), document.command or document.shown_by)

    def _sources(self, names: str) -> list[Source]:
        return [self._document.sources[name] for name in names.split()]


def render(document: Document, figures: Mapping[str, Sequence[Panel]]) -> str:
    """Render a page to HTML, twice because the table of contents precedes the sections.

    Raises jinja2.UndefinedError or KeyError: the template uses a value, figure, table or source that is
    missing.
    """
    template, helpers = document.environment().get_template(document.template), document.helpers(figures)
    given = {name: getattr(helpers, name) for name in dir(type(helpers)) if not name.startswith("_")}
    given |= {"document": document, **document.facts}
    template.render(given, contents=[])
    return template.render(given, contents=helpers.contents.copy())


@lru_cache
def environment(*packages: str) -> Environment:
    """Jinja environment with escaping; undefined names are errors.

    Templates are searched for in the packages, in order, then in this one; `reporting/NAME` is always this
    one's, so that a template can extend the one that it replaces.
    """
    own = PackageLoader("structlearn.reporting")
    folders = [PackageLoader(package, "") for package in packages]
    made = Environment(
        loader=ChoiceLoader([*folders, own, PrefixLoader({"reporting": own})]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["f"] = lambda value, digits: prose.rounded(value + 0, digits)  # + 0 fails if undefined
    made.filters["words"] = lambda found, *how: in_words(replace(found, people=None), *how)  # without ICC
    for filter_ in (prose.listing, prose.counted, prose.capitalised, cell, anchor):
        made.filters[filter_.__name__] = filter_
    for function in (prose.interval, prose.with_interval, prose.with_spread, prose.percent):
        made.globals[function.__name__] = function
    made.tests["numeric"] = is_numeric
    return made


def source_commit(folders: Iterable[str] = ("src", "stages"), root: Path = Path(".")) -> str:
    """Commit that last changed the sources, e.g. `b9b799a1`, with `+changes` if folders differ from it.

    A commit of results alone is not named, so a page made again after it is the same. Locks do not count.
    Returns `UNKNOWN_COMMIT` without git or without a repository of this project.
    """
    sources = [*folders, ":(exclude)*.lock"]

    def git(*arguments: str) -> str | None:
        command = ["git", "-C", str(root), *arguments]
        try:
            return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
        except (OSError, subprocess.CalledProcessError):
            return None

    if git("rev-parse", "--show-prefix") != "":  # a repository around this project, or none
        return UNKNOWN_COMMIT
    commit = git("log", "-1", "--format=%H", "--", *sources)
    if not commit:
        return UNKNOWN_COMMIT
    return f"{commit[:8]}+changes" if git("status", "--porcelain", "--", *sources) else commit[:8]


def anchor(heading: str) -> str:
    """HTML anchor of a heading: lower-case letters and digits, words joined by dashes."""
    words = "".join(letter if letter.isalnum() else " " for letter in heading.lower())
    return "-".join(words.split())


def words_in_view(page: str) -> int:
    """Number of words on a page outside folded parts."""
    for hidden in ("style", "script", "head"):
        page = re.sub(rf"<{hidden}\b.*?</{hidden}>", " ", page, flags=re.DOTALL)
    innermost = re.compile(r"<details\b(?:(?!<details\b).)*?</details>", re.DOTALL)
    while innermost.search(page):  # folds can be nested
        page = innermost.sub(" ", page)
    return len(re.sub(r"<[^>]*>", " ", page).split())


def is_numeric(column: pd.Series) -> bool:
    """Whether a column has numbers, which are right-aligned."""
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def cell(value: object, number_format: str = "") -> str:
    """Text of a table cell: yes or no, a number with a true minus sign, or a dash if missing."""
    if value is None or (isinstance(value, float | np.floating) and not np.isfinite(value)):
        return MISSING
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        number_format = number_format or ".6g"  # further digits depend on the processor
    elif not isinstance(value, int | np.number):
        return str(value)
    return prose.spelled(value, number_format)


def parameter_table(parameters: Mapping[str, Parameters]) -> pd.DataFrame:
    """Parameters by name as for `dvc exp run --temp -S`, given models keyed as in `params.yaml`."""
    rows = [row for key, model in parameters.items() for row in _rows(key, model.model_dump(mode="json"))]
    return pd.DataFrame(rows, columns=["parameter", "value"])


def _rows(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Dotted name and value of every leaf; lists of plain values, and dicts in lists, are one leaf."""
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
