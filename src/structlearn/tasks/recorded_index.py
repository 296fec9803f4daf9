"""The page over all public sets, of what their own pages say: verdicts side by side, leads, main figures."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from structlearn.core.artefacts import read_csv
from structlearn.core.params import value_at
from structlearn.reporting.claims import NOT_TESTED, Evidence, Judged, combined, read_claims, verdict_in
from structlearn.reporting.document import Document, environment
from structlearn.reporting.findings import Findings, read_findings
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.project import CLONE, OF_PUBLIC, pipeline
from structlearn.tasks.task_entry import read_entries
from structlearn.tasks.task_files import TaskFiles

PACKAGE = "structlearn.tasks"
REPORT = Path("reports/recorded")
SIMULATED = ("scraping", "obstacles", "dynamics", "servoing")
"""Testbeds whose statements are held against like ones about recordings."""

SENTENCES = 2
"""Of what opens a set's page, that the page over all sets quotes."""

HEADLINES: Mapping[str, tuple[str, str, str]] = {
    "reach_cut_error_ms_2mm": ("reaches", "reach_cut_error_ms_2mm", ""),
    "reach_left_ten_out_mean_mm": ("reaches", "primitives_reach_left_out_mm", ""),
    "coupling_path_mean_mm": ("reaches", "coupling_path_mean_mm", ""),
    "obstacle_nmse_x": ("avoidance", "nmse_x", ""),
    "boxes_hits": ("boxes", "hits", ""),
    "boxes_path_mm": ("boxes", "path", ""),
    "touch_reconstruction_nmse_simulated_to_slides": (
        "biotac",
        "reconstruction_nmse_simulated_to_slides",
        "",
    ),
    "eflesh_map_nmse": ("eflesh", "map_nmse", ""),
    "eflesh_latent_mm": ("eflesh", "latent_mm", ""),
    "panda_nmse_cov_coulomb": ("panda", "nmse", ""),
    "ur10e_nmse_mean_cov_coulomb": ("ur10e", "nmse", ""),
    "ur10e_load_kg": ("ur10e", "load_kg", ""),
}
"""Of `metrics.json`: task, name and case of the finding."""


@dataclass(frozen=True)
class Reported:
    """What the page of a public set says.

    Attributes:
        name: of the task.
        title: of its page.
        lead: what came out, in HTML.
        picture: main figure, in HTML.
        absent: whether nothing of it is recorded here.
        left_out: `file` and `reason` of what could not be read.
        judged: claims with their verdicts.
    """

    name: str
    title: str
    lead: Markup
    picture: Markup
    absent: bool
    left_out: Sequence[Mapping[str, str]]
    judged: Sequence[Judged]


def publish_index() -> None:
    """Publish the page with the verdicts on all public sets.

    Raises:
        InputError: the page of a set was not made.
    """
    sets = [reported(name) for name, one in read_entries().items() if one.file.name == OF_PUBLIC]
    judged = [claim for one in sets for claim in one.judged]
    both = [one for one in judged if one.simulated not in ("", NOT_TESTED) and one.verdict != NOT_TESTED]
    alike = sum(one.verdict == one.simulated for one in both)
    page = Document(
        template="recorded_index.html.jinja",
        package=PACKAGE,
        stage=f"{pipeline()}:recorded_report",
        facts={"sets": sets, "in_both": len(both), "alike": alike},
        judged=judged,
        command="make recorded DATA=FOLDER",
    )
    publish_report(REPORT, {"index": page}, {}, {}, headlines([one.name for one in sets]))


def reported(name: str) -> Reported:
    """What the page of a set says, with verdicts on like statements of the simulated testbeds."""
    files = TaskFiles(name)
    page = (files.report / "index.html").read_text(encoding="utf-8")
    title = value_at(files.parameters, "entry.title") or name
    figure = re.search(r'<div class="panels.*?</div>', page, re.DOTALL) if not files.absent else None
    picture = re.sub(r'(src|href)="', rf'\1="../tasks/{name}/', figure[0]) if figure else ""
    lead = re.search(r'(?<=<p class="lead">).*?(?=</p>)', page, re.DOTALL)
    sentences = re.split(r"(?<=[.?!])\s+(?=[A-Z])", lead[0] if lead else "")
    return Reported(
        name,
        title,
        Markup(" ".join(sentences[:SENTENCES]).replace('href="../../', 'href="../')),
        Markup(picture),
        bool(files.absent),
        files.left_out().to_dict("records"),
        [replace(one, heading=title, simulated=simulated(one)) for one in judged_again(name)],
    )


def simulated(one: Judged) -> str:
    """The verdict of a simulated testbed on the like statement, as its report has it; else empty."""
    like = one.claim.simulated
    path = Path("reports", like.testbed if like else "", "tables/claims.csv")
    return verdict_in(read_csv(path, keep_default_na=False), like) if like and path.exists() else ""


def judged_again(name: str) -> list[Judged]:
    """Claims about a set with the verdicts that its page has."""
    path = CLONE / "claims" / f"{name}.yaml"
    if not path.exists():
        return []
    table = read_csv(TaskFiles(name).report / "tables/claims.csv", keep_default_na=False)
    keys = table[["statement", "source", "evidence"]]
    rows = [its for _, its in table.groupby((keys != keys.shift()).any(axis=1).cumsum())]
    plain = environment(PACKAGE).overlay(autoescape=False)
    judged = []
    for claim, its in zip(read_claims(path), rows, strict=True):
        texts = its.iloc[0][["statement", "source", "published"]].to_dict()
        texts |= {"note": plain.from_string(claim.note).render()}
        cases = tuple(its[["case", "here", "n", "verdict"]].itertuples(index=False, name=None))
        verdict = combined([case[-1] for case in cases])
        judged.append(
            Judged(
                claim.model_copy(update=texts),
                cases,
                verdict,
                tuple(its["study"]),
                tuple(its["would_decide"]),
            )
        )
    return judged


def headlines(names: Collection[str]) -> Findings:
    """Those of `HEADLINES` that were found on some sets."""
    find = Findings()
    there = {key: where for key, where in HEADLINES.items() if where[0] in names}
    for key, (task, name, case) in there.items():
        table = read_findings(TaskFiles(task).report / "findings.csv")
        for row in table[(table["name"] == name) & (table["case"] == case)].itertuples():
            if pd.notna(row.value):
                found = Evidence(row.value, row.low, row.high, int(row.n))
                find.among(row.population).add(key, found, unit=row.unit, headline=True)
    return find
