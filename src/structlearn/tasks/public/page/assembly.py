"""The pages of the recorded data put together from the parts for which there are data.

Another set of recorded data is one more `Part` in `PARTS` and, where it goes into a page of its own, one more
title in `PAGES`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics, read_csv
from structlearn.core.params import read_values
from structlearn.reporting.claims import NOT_TESTED, Found, Judged, judge, unknown, verdict_in
from structlearn.reporting.document import Document, Source, Table, anchor, environment
from structlearn.reporting.figure_style import Drawing
from structlearn.tasks.public.page.parts import (
    avoidance_part,
    boxes_part,
    panda_part,
    ur10e_part,
)
from structlearn.tasks.public.page.parts.part import Part
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.public_files import TABLES

PACKAGE = __package__
STAGE = "stages/recorded/dvc.yaml:report"

PARTS = (
    avoidance_part.PART,
    boxes_part.PART,
    panda_part.PART,
    ur10e_part.PART,
)
"""In the order of the index."""

PAGES = {
    "avoidance": "Recorded obstacle avoidance",
    "boxes": "People past boxes: one obstacle's features, and a look ahead",
    "panda": "Inverse dynamics of a recorded Franka Panda",
    "ur10e": "A second arm: a UR10e and its load",
}
"""Titles of the pages behind the index."""

HEADLINES = (
    "obstacle_nmse_x",
    "boxes_hits",
    "boxes_path_mm",
    "panda_nmse_cov_coulomb",
    "ur10e_nmse_mean_cov_coulomb",
    "ur10e_load_kg",
)
"""The metrics that stand for all others."""


@dataclass(frozen=True)
class RecordedReport:
    """What `publishing.publish_report` takes beside the figures."""

    pages: dict[str, Document]
    tables: dict[str, Table]
    metrics: Metrics

    @property
    def headlines(self) -> list[str]:
        """Those of `HEADLINES` that are known."""
        return [name for name in HEADLINES if name in self.metrics]


def recorded_report(results: RecordedResults, reports: Path = Path("reports")) -> RecordedReport:
    """The index with all verdicts, and the pages behind it."""
    there = [part for part in PARTS if part.there(results)]
    found = {name: value for part in there for name, value in part.metrics(results).items()}
    metrics = {name: value for name, value in found.items() if known(value)}
    tables = {name: table for part in there for name, table in part.tables(results).items()}
    facts: dict[str, Any] = {"published": published()} | found
    for part in there:
        facts |= part.facts(results)
    simulated = simulated_claims(reports)
    judged = [one for part in PARTS for one in judged_part(part, results, facts, simulated)]
    both = [one for one in judged if one.simulated not in ("", NOT_TESTED) and one.verdict != NOT_TESTED]
    facts |= {
        "parts": PARTS,
        "left_out": results.left_out.to_dict("records"),
        "pages": PAGES,
        "there": {part.name for part in there},
        "links": {part.name: f"{part.page}.html#{anchor(part.heading)}" for part in PARTS},
        "in_both": len(both),
        "alike": sum(one.verdict == one.simulated for one in both),
    }
    index = Document(
        template="index.html.jinja",
        package=PACKAGE,
        stage=STAGE,
        facts=facts,
        tables=tables,
        judged=judged,
        sources={name: source(path) for name, path in TABLES.items()},
        recordings="../rerun/recorded",
    )
    pages = {"index": index}
    for name, title in PAGES.items():
        its = [part for part in PARTS if part.page == name]
        keys = [key for part in its for key in part.parameters if key in results.parameters]
        pages[name] = replace(
            index,
            template="details.html.jinja",
            facts=facts | {"title": title, "its_parts": its},
            judged=[one for one in judged if one.heading == its[0].heading] if len(its) == 1 else (),
            parameters={key: results.parameters[key] for key in keys},
        )
    return RecordedReport(pages, tables, metrics)


def recorded_pictures(results: RecordedResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """The figures of all parts that are there, by name."""
    there = [part for part in PARTS if part.there(results)]
    return {name: drawing for part in there for name, drawing in part.pictures(results).items()}


def judged_part(
    part: Part, results: RecordedResults, facts: Mapping[str, object], simulated: Mapping[str, pd.DataFrame]
) -> list[Judged]:
    """A part's claims, not tested where there are no data of it, with verdicts on their counterparts."""
    found: dict[str, Found] = {claim.evidence: unknown("not recorded here") for claim in part.claims}
    if part.there(results):
        found = {
            name: its or unknown("nothing recorded decides it")
            for name, its in part.evidence(results).items()
        }
    judged = []
    for one in judge(part.claims, found, environment(PACKAGE), facts):
        like = one.claim.simulated
        beside = verdict_in(simulated[like.testbed], like) if like and like.testbed in simulated else ""
        judged.append(replace(one, heading=part.heading, simulated=beside))
    return judged


def simulated_claims(reports: Path) -> dict[str, pd.DataFrame]:
    """Tables of claims by testbed, as they are kept beside the reports."""
    files = {testbed: reports / testbed / "tables/claims.csv" for testbed in SIMULATED}
    return {
        testbed: read_csv(file, keep_default_na=False) for testbed, file in files.items() if file.exists()
    }


SIMULATED = ("scraping", "obstacles", "dynamics", "servoing")


def known(value: object) -> bool:
    """Whether a metric is one: of too few data it is NaN."""
    return not (isinstance(value, float) and np.isnan(value))


def source(path: str, stage: str = "") -> Source:
    """Of a table of the recorded data; the stage has the folder's name where none is given."""
    return Source(f"data/recorded/{path}.parquet", f"stages/recorded/dvc.yaml:{stage or path.split('/')[0]}")


def published() -> dict[str, float]:
    """What the dissertation prints."""
    return read_values(Path(__file__).with_name("published.yaml"))
