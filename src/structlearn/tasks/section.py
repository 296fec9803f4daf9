"""What a part of a task gives to the task's page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from structlearn.reporting.document import Source, Table
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings


@dataclass(frozen=True)
class Section:
    """One section of the page of a task.

    Attributes:
        name: of the part; its templates find its facts under it.
        heading: above it.
        template: file beside the module that makes the section, with its sentences.
        lead: likewise, what opens the page: `<p class="lead">` with a sentence or two, and the main figure;
            the index of public sets quotes both.
        facts: what the sentences name.
        find: every number that it states, in a table; claims and templates name its rows.
        tables: by name.
        pictures: by name.
        sources: of figures and tables by name: a folder of the task's data, and the stage that writes it;
            the sections of a page may share them.
    """

    name: str
    heading: str
    template: str
    lead: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    find: Findings = field(default_factory=Findings)
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Drawing | Sequence[Drawing]] = field(default_factory=dict)
    sources: Mapping[str, Source] = field(default_factory=dict)
