"""Page of a public set: a task's page with verdicts on claims, and sections that only sets have."""

from collections.abc import Mapping
from dataclasses import dataclass

from jinja2 import Environment

from dissertation.evidence.claims import Judged, judge, read_claims
from dissertation.evidence.page import TEMPLATES, JudgedDocument, publish_judged
from dissertation.recorded import representations_section, transfer_section
from structlearn.core.params import read_values
from structlearn.reporting.document import environment
from structlearn.reporting.evidence import unknown
from structlearn.reporting.findings import Findings
from structlearn.tasks.project import CLONE
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.task_page import MakeSection, task_page

SECTIONS: Mapping[str, tuple[MakeSection, ...]] = {
    "touch": (transfer_section.section,),
    "obstacles": (representations_section.section,),
}
"""Sections by kind of data, after those of every task."""


@dataclass(frozen=True)
class SetDocument(JudgedDocument):
    """Contents of a set's page: its own templates stand before those of a task."""

    def environment(self) -> Environment:
        """Jinja environment with the templates of sets, of tasks and of the reproduction."""
        return environment(__package__, self.package, TEMPLATES)


def publish_set(files: TaskFiles) -> None:
    """Publish a set's page with its figures, tables, claims and findings."""
    page = task_page(files, SECTIONS.get(files.kind, ()))
    verdicts = judged(files.name, page.find, page.document.facts)
    own = {"template": "set.html.jinja", "root": "../..", "judged": verdicts}
    document = SetDocument(**vars(page.document) | own)
    publish_judged(files.report, {"index": document}, page.pictures, document.tables, page.find)


def judged(name: str, find: Findings, facts: Mapping[str, object]) -> list[Judged]:
    """Judge the claims in `claims/NAME.yaml` beside a set's entry; not tested if there are no data."""
    path = CLONE / "claims" / f"{name}.yaml"
    if not path.exists():
        return []
    claims = read_claims(path)
    without = unknown("nothing recorded decides it" if find else "not recorded here")
    found = {one.evidence: find.get(one.evidence) or without for one in claims}
    published = path.with_name("published.yaml")
    printed = read_values(published) if published.exists() else {}
    return judge(claims, found, {"published": printed} | dict(facts))
