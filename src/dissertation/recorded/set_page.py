"""Page of a public set: a task's page, with verdicts on the claims about the set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment
from markupsafe import Markup

from dissertation.evidence.claims import Judged, judge, read_claims
from dissertation.evidence.judged_page import TEMPLATES, JudgedDocument, VerdictHelpers, publish_judged
from structlearn.core.params import read_values
from structlearn.reporting.document import Panel, environment
from structlearn.reporting.evidence import unknown
from structlearn.reporting.findings import Findings
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.task_page import task_page

CLAIMS = Path(__file__).with_name("claims")
COMMAND, PROJECT = (
    "make recorded DATA=FOLDER",
    "data/recorded",
)  # from the clone, where pages are kept


@dataclass(frozen=True)
class SetDocument(JudgedDocument):
    """Contents of a set's page: its own templates stand before those of a task."""

    def environment(self) -> Environment:
        """Jinja environment with the templates of sets, of tasks and of the reproduction."""
        return environment(__package__, self.package, TEMPLATES)

    def helpers(self, figures: Mapping[str, Sequence[Panel]]) -> "SetHelpers":
        """Functions for the page's templates."""
        return SetHelpers(self, figures)


class SetHelpers(VerdictHelpers):
    """Functions for the templates of sets, whose recordings only `COMMAND` makes."""

    def recording(self, name: str, note: str) -> Markup:
        """File of a recording, not linked because the page is kept without it, and what it contains."""
        return self._parts.recorded(f"{self._document.recordings}/{name}.rrd", note, COMMAND)


def publish_set(files: TaskFiles) -> None:
    """Publish a set's page with its figures, tables, claims and findings."""
    page = task_page(files)
    facts = {**page.document.facts, "again": COMMAND, "inside": PROJECT}
    facts["file"] = "src/dissertation/recorded/public.yaml"
    own = {
        "template": "set.html.jinja",
        "facts": facts,
        "judged": judged(files.name, page.find, facts),
        "recordings": f"{PROJECT}/{files.report}/rerun",
        "root": "../..",
        "clone": "../..",
        "command": COMMAND,
    }
    document = SetDocument(**vars(page.document) | own)
    publish_judged(files.report, {"index": document}, page.pictures, document.tables, page.find)


def judged(name: str, find: Findings, facts: Mapping[str, object]) -> list[Judged]:
    """Judge the claims in `claims/NAME.yaml`; not tested if there are no data."""
    path = CLAIMS / f"{name}.yaml"
    if not path.exists():
        return []
    claims = read_claims(path)
    without = unknown("nothing recorded decides it" if find else "not recorded here")
    found = {one.evidence: find.get(one.evidence) or without for one in claims}
    return judge(claims, found, {"published": read_values(path.with_name("published.yaml"))} | dict(facts))
