"""Section of a task's page, and its tables with headings and formats from column names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from jinja2 import Template

from structlearn.reporting.document import Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings

# Heading suffix and number format, by suffix of the column name
UNITS = {
    "_n_m": (" (N m)", ".2f"),
    "_mm": (" (mm)", ".2f"),
    "_ms": (" (ms)", ".1f"),
    "_kg": (" (kg)", ".2f"),
    "_m": (" (m)", ".3f"),
    "_deg": (" (°)", ".2f"),
    "_s": (" (s)", ".2f"),
    "_hz": (" (Hz)", ".1f"),
    "_counts": (" (counts)", ".1f"),
    "_share": (" (share)", ".1%"),
    "": ("", ".3g"),
}

# Words of column names that are replaced in headings
WORDS = {"max": "largest", "nmse": "NMSE", "rms": "RMS"}


@dataclass(frozen=True)
class Section:
    """One section of a task's page; its templates are beside the module that makes it."""

    name: str  # key of its facts in templates
    heading: str
    template: str | Template = (
        ""  # default: `NAME.html.jinja`, preceded by `NAME_lead.html.jinja` if it exists
    )
    lead: str | Template = (
        ""  # opening of the page: `<p class="lead">` with a sentence or two, and the main figure
    )
    facts: Mapping[str, Any] = field(default_factory=dict)  # values for the sentences
    find: Findings = field(default_factory=Findings)  # all numbers that it states
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Drawing | Sequence[Drawing]] = field(default_factory=dict)
    # for figures and tables, by name: a folder of the task's data, and the stage that writes it; shared
    sources: Mapping[str, Source] = field(default_factory=dict)


def shown(frame: pd.DataFrame, strong: frozenset[int] = frozenset(), /, **formats: str) -> Table:
    """Table with headings and formats derived from its column names; `formats` override."""
    headings, number_formats = {}, {}
    for name in frame:
        ending = next(ending for ending in UNITS if str(name).endswith(ending))
        unit, number_formats[name] = UNITS[ending]
        words = str(name).removesuffix(ending).split("_")
        headings[name] = " ".join(WORDS.get(word, word) for word in words) + unit
        if pd.api.types.is_integer_dtype(frame[name]):
            number_formats[name] = ""
    return Table(frame, number_formats | formats, headings, strong)
