"""Page of a public set: that of a task, with verdicts on the claims about it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from structlearn.core.params import read_values
from structlearn.reporting.claims import Judged, judge, read_claims, unknown
from structlearn.reporting.document import environment
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.task_page import task_page

CLAIMS = Path(__file__).with_name("claims")
COMMAND = "make recorded DATA=FOLDER"


def publish_set(files: TaskFiles) -> None:
    """Publish a set's page with its figures, tables, claims and findings."""
    page = task_page(files)
    facts = {**page.document.facts, "again": COMMAND}
    document = replace(
        page.document, facts=facts, command=COMMAND, judged=judged(files.name, page.find, facts)
    )
    publish_report(files.report, {"index": document}, page.pictures, document.tables, page.find)


def judged(name: str, find: Findings, facts: Mapping[str, object]) -> list[Judged]:
    """Judge the claims in `claims/NAME.yaml`; not tested if there are no data."""
    path = CLAIMS / f"{name}.yaml"
    if not path.exists():
        return []
    claims = read_claims(path)
    without = unknown("nothing recorded decides it" if find else "not recorded here")
    found = {one.evidence: find.get(one.evidence) or without for one in claims}
    facts = {"published": read_values(path.with_name("published.yaml"))} | dict(facts)
    return judge(claims, found, environment(__package__), facts)
