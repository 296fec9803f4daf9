"""Pages with verdicts: the library's documents and reports, extended by judged claims."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

from dissertation.evidence.claims import (
    VERDICTS,
    Judged,
    OnRecordings,
    claim_metrics,
    claims_table,
    on_recordings,
    verdict_counts,
)
from structlearn.reporting.document import Document, PageHelpers, Panel, Table, environment
from structlearn.reporting.figure_style import Drawing
from structlearn.reporting.findings import Findings
from structlearn.reporting.publishing import publish_report

TEMPLATES = "dissertation.evidence.templates"


@dataclass(frozen=True)
class JudgedDocument(Document):
    """Contents of a page of the reproduction."""

    judged: Sequence[Judged] = ()  # claims with their verdicts
    recorded: Sequence[OnRecordings] = ()  # statements that were also tested on recorded data
    basis: str = ""  # sentence on the provenance of verdicts from studies
    root: str = ".."  # folder of the front page, relative to this page

    def environment(self) -> Environment:
        """Jinja environment with the reproduction's templates."""
        return environment(self.package, TEMPLATES)

    def helpers(self, figures: Mapping[str, Sequence[Panel]]) -> "VerdictHelpers":
        """Functions for the page's templates."""
        return VerdictHelpers(self, figures)


class VerdictHelpers(PageHelpers):
    """Functions for the templates of pages with verdicts."""

    def __init__(self, document: JudgedDocument, figures: Mapping[str, Sequence[Panel]]) -> None:
        super().__init__(document, figures)
        self._judged = document
        self._verdicts: Any = document.environment().get_template("verdicts.html.jinja").module

    def verdicts(self) -> Markup:
        """Table of verdicts below their counts, grouped by data set if there are several."""
        judged = self._judged.judged
        counts = {by: verdict_counts(judged, by) for by in ("published", "ours")}
        several = any(one.heading for one in judged)
        table = self._verdicts.verdicts_by_set if several else self._verdicts.verdicts
        return table(judged, counts, VERDICTS)

    def on_recordings(self) -> Markup:
        """Table of statements that were also tested on recorded data."""
        return self._verdicts.on_recordings(self._judged.recorded)

    def footer(self) -> Markup:
        """Links to the other pages, and this page's provenance."""
        return self._parts.footer(self._provenance(), self._verdicts.links(self._judged.root))


def publish_judged(
    folder: str | Path,
    pages: Mapping[str, JudgedDocument],
    drawings: Mapping[str, Drawing | Sequence[Drawing]],
    tables: Mapping[str, Table],
    find: Findings,
    recorded: pd.DataFrame | None = None,
) -> None:
    """Publish a report with `tables/claims.csv` and the counts of verdicts in `metrics.json`.

    `recorded`: claims about recorded data, to show beside statements tested on them too; otherwise as
    `publish_report`.
    """
    shown = {id(one): one for page in pages.values() for one in page.judged}  # pages may share claims
    judged = list(shown.values())
    on_page = {one.claim.evidence: name for name, page in pages.items() for one in page.judged}
    table = claims_table(judged, on_page)
    both = [] if recorded is None else on_recordings(recorded, Path(folder).name, table)
    completed = {
        name: replace(page, recorded=[one for one in both if one.counterpart.page == name])
        for name, page in pages.items()
    }
    tables = {**tables, "claims": Table(table)} if judged else tables
    publish_report(folder, completed, drawings, tables, find, claim_metrics(judged))
