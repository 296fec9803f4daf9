"""What a part of a task gives to the task's page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from structlearn.core.artefacts import Metrics
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import Drawing


@dataclass(frozen=True)
class Section:
    """One section of the page of a task.

    Attributes:
        name: of the part, e.g. `motion`; its key in the task's parameters and its folder in the task's data.
        heading: above it.
        template: file beside this module with its sentences; they find `facts` under `name`.
        facts: what they name.
        metrics: flat, all begin with `name`.
        tables: by name.
        pictures: by name.
    """

    name: str
    heading: str
    template: str
    facts: Mapping[str, object] = field(default_factory=dict)
    metrics: Metrics = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Mapping[str, Drawing | Sequence[Drawing]] = field(default_factory=dict)
