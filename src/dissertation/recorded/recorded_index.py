"""Page over all public data sets: verdicts side by side, and a sentence and the main figure of each."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from dissertation.evidence.claims import Judged, combined, read_claims, rendered, verdict_in
from dissertation.evidence.judged_page import JudgedDocument, publish_judged
from dissertation.recorded.people import COLUMNS, PEOPLE
from structlearn.core.artefacts import read_csv
from structlearn.core.params import read_values, value_at
from structlearn.reporting.document import Source, Table, environment
from structlearn.reporting.evidence import NOT_TESTED, Evidence
from structlearn.reporting.findings import Findings, read_findings, values_by_key
from structlearn.tasks.task_entry import read_entries
from structlearn.tasks.task_files import TaskFiles

HERE, CLONE = Path(__file__).parent, Path("../..")  # the second: of the project of public sets
REPORT, QUOTED = Path("reports/recorded"), HERE / "recorded.yaml"
HEADINGS = {"between_std": "between people", "within_std": "within a person", "share": "share between"}


def publish_index() -> None:
    """Publish the page over all public sets. Raises InputError: a set's page was not made."""
    names = list(read_entries())
    quoted: Mapping[str, Mapping[str, Any]] = read_values(QUOTED)
    sets = [{"name": name} | summary(TaskFiles(name), quoted.get(name, {})) for name in names]
    judged = [claim for one in sets for claim in reload_verdicts(one["name"], one["title"])]
    both = [one for one in judged if one.simulated not in ("", NOT_TESTED) and one.verdict != NOT_TESTED]
    alike = sum(one.verdict == one.simulated for one in both)
    people = read_csv(PEOPLE) if PEOPLE.exists() else pd.DataFrame(columns=COLUMNS)
    words = {"quantity": {name: name.partition("_")[0] for name in people["quantity"]}}
    shown = Table(people, dict.fromkeys(COLUMNS[4:10], ".3f"), HEADINGS, words=words)
    page = JudgedDocument(
        template="recorded_index.html.jinja",
        package=__package__,
        stage="recorded_report",
        facts={"sets": sets, "in_both": len(both), "alike": alike, "people": people},
        tables={"people": shown},
        sources={"people": Source(PEOPLE.as_posix(), "recorded_people")},
        judged=judged,
        clone=str(CLONE),
        command="make recorded DATA=FOLDER",
    )
    publish_judged(REPORT, {"index": page}, {}, page.tables, headlines(quoted, names))


def summary(files: TaskFiles, quoted: Mapping[str, Any]) -> dict[str, Any]:
    """Summary of a set: `title`, `says` (sentence), `figure`, `opening`, `absent` and `left_out`."""
    quoted = {} if files.absent else quoted
    says = environment().from_string(quoted.get("says", ""))
    return {
        "title": value_at(files.parameters, "entry.title") or files.name,
        "says": says.render(values_by_key(read_findings(files.report / "findings.csv"))),
        "figure": quoted.get("figure", ()),
        "opening": quoted.get("opening", {}),
        "absent": bool(files.absent),
        "left_out": files.left_out().to_dict("records"),
    }


def reload_verdicts(name: str, title: str) -> list[Judged]:
    """Claims about a set with the verdicts from its page, and those of their simulated counterparts."""
    path = HERE / "claims" / f"{name}.yaml"
    if not path.exists():
        return []
    table = read_csv(
        TaskFiles(name).report / "tables/claims.csv",
        keep_default_na=False,
        na_values=dict.fromkeys(("value", "low", "high"), ""),
    )
    keys = table[["statement", "source", "evidence"]]
    rows = [its for _, its in table.groupby((keys != keys.shift()).any(axis=1).cumsum())]
    judged = []
    for claim, its in zip(read_claims(path), rows, strict=True):
        texts = its.iloc[0][["statement", "source", "published"]].to_dict()
        like, alike = claim.simulated, ("", "")
        there = CLONE / "reports" / (like.testbed if like else "") / "tables/claims.csv"
        if like and there.exists():
            alike = verdict_in(read_csv(there, keep_default_na=False), like)
        judged.append(
            Judged(
                claim.model_copy(update=texts | {"note": rendered(claim.note, {})}),
                tuple(its[["case", "here", "n", "verdict"]].itertuples(index=False, name=None)),
                combined(list(its["verdict"])),
                tuple(_reloaded(row, claim.format) for row in its.itertuples()),
                tuple(its["would_decide"]),
                title,
                *alike,
            )
        )
    return judged


def _reloaded(row: Any, number_format: str) -> Evidence:
    """Evidence of one row of a `claims_table`, as far as the table has it."""
    count = int(row.value) if number_format == "count" and row.value == row.value else None
    return Evidence(row.value, row.low, row.high, row.n, count, unit=row.unit, study=row.study)


def headlines(quoted: Mapping[str, Mapping[str, Any]], names: Collection[str]) -> Findings:
    """Headline findings of the sets that have them."""
    find = Findings()
    for task in (task for task in quoted if task in names):
        table = read_findings(TaskFiles(task).report / "findings.csv")
        table = table[(table["case"] == "") & table["value"].notna()]
        for key, name in quoted[task].get("headlines", {}).items():
            for row in table[table["name"] == name].itertuples():
                found = Evidence(row.value, row.low, row.high, int(row.n))
                find.among(row.population).add(key, found, unit=row.unit, headline=True)
    return find
