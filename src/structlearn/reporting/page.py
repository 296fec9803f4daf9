"""Report pages: small frozen descriptions in, one self-contained HTML string out.

A page needs no network and no JavaScript; its figures, tables and recordings lie beside it. The same
description gives the same bytes: no dates, no versions, no wall times.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

MISSING = "\N{EN DASH}"
HOW_TO_OPEN = "Open a recording with `rerun FILE` (the program comes with `pip install rerun-sdk`)."

Sizes = Mapping[str, tuple[int, int]]
"""Pixels of figures by their name."""


@dataclass(frozen=True)
class Prose:
    """One paragraph; text between backticks is set as code, all else is plain."""

    text: str


@dataclass(frozen=True)
class Figure:
    """A picture beside the page.

    Attributes:
        source: path relative to the page.
        caption: what it shows and where that comes from.
        alt: what a reader hears who cannot see it.
        pixels: width and height, so that the text does not jump while it loads.
    """

    source: str
    caption: str
    alt: str
    pixels: tuple[int, int] | None = None


@dataclass(frozen=True)
class Table:
    """A table of a data frame, without its index.

    Attributes:
        frame: the rows, in order.
        caption: what they are.
        formats: by column, how a number is written, e.g. `.1f`; other numbers are written as they are.
        headings: by column, what is written above it; default the column's name.
        strong: row positions that are set in bold.
        source: path of the same table as CSV, relative to the page.
        folded: hidden until the reader opens it; for long tables.
    """

    frame: pd.DataFrame
    caption: str = ""
    formats: Mapping[str, str] = field(default_factory=dict)
    headings: Mapping[str, str] = field(default_factory=dict)
    strong: frozenset[int] = frozenset()
    source: str | None = None
    folded: bool = False


@dataclass(frozen=True)
class Link:
    """A file to open.

    Attributes:
        target: path relative to the page.
        label: its name.
        note: what is in it, or how it is opened.
    """

    target: str
    label: str
    note: str = ""


@dataclass(frozen=True)
class Links:
    """A list of links."""

    links: tuple[Link, ...]


@dataclass(frozen=True)
class KeyNumber:
    """One of the few numbers at the top of a page: formatted with its unit, and what it is."""

    value: str
    label: str


@dataclass(frozen=True)
class KeyNumbers:
    """A strip of key numbers."""

    numbers: tuple[KeyNumber, ...]


Block = Prose | Figure | Table | Links | KeyNumbers


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes:
        heading: its title.
        blocks: what is in it, in order.
        simulated: whether the data shown are simulated; it is labelled so.
        link: page that its heading leads to.
    """

    heading: str
    blocks: tuple[Block, ...]
    simulated: bool = False
    link: str | None = None


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes:
        title: its title.
        lead: one or two sentences below the title.
        sections: in order.
        key_numbers: the strip at the top.
        simulated: whether everything on it is simulated.
        back: page above this one.
    """

    title: str
    lead: str
    sections: tuple[Section, ...]
    key_numbers: tuple[KeyNumber, ...] = ()
    simulated: bool = False
    back: Link | None = None


def beside(name: str, sizes: Sizes, caption: str, alt: str) -> Figure:
    """The figure of a name where every page has it: `figures/NAME.png`."""
    return Figure(f"figures/{name}.png", caption, alt, sizes.get(name))


def render(page: Page) -> str:
    """The page as HTML; text is escaped, equal pages give equal strings."""
    return _environment().get_template("page.html.jinja").render(page=page)


@lru_cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("structlearn.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"prose": prose, "anchor": anchor, "cell": cell, "kind": kind}
    environment.tests["numeric"] = is_numeric
    return environment


def kind(block: Block) -> str:
    """Name of a block's class in lower case, by which the template chooses."""
    return type(block).__name__.lower()


def prose(text: str) -> Markup:
    """Escaped text; what is between backticks becomes code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if place % 2 else escape(part)
        for place, part in enumerate(parts)
    )


def anchor(heading: str) -> str:
    """Name of a heading in the page's address: letters and digits, dashes between words."""
    words = "".join(letter if letter.isalnum() else " " for letter in heading.lower())
    return "-".join(words.split())


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
        return format(value, number_format).replace("-", "\N{MINUS SIGN}")
    return str(value)
