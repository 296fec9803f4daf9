"""What a part of a task gives to the task's page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from structlearn.reporting.document import Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings


@dataclass(frozen=True)
class Section:
    """One section of the page of a task; its templates lie beside the module that makes it."""

    name: str  # under which its templates find its facts
    heading: str
    template: str = ""  # its sentences; by default `NAME.html.jinja`, after `NAME_lead.html.jinja` if there
    lead: str = ""  # what opens the page: `<p class="lead">` with a sentence or two, and the main figure
    facts: Mapping[str, Any] = field(default_factory=dict)  # what the sentences name
    find: Findings = field(default_factory=Findings)  # every number that it states
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Drawing | Sequence[Drawing]] = field(default_factory=dict)
    # of figures and tables by name: a folder of the task's data, and the stage that writes it; shared
    sources: Mapping[str, Source] = field(default_factory=dict)
