"""Section of a task's page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jinja2 import Template

from structlearn.reporting.document import Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings


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
