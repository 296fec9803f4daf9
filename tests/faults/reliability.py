"""The page of what was broken on purpose: damaged files, crashes, kills, a controller under faults.

Each of the commands that break things (`make faults`, `make kills`, `make upsets`) leaves its table here,
with counts and no wall times, and makes the page of all last results again.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from dissertation.evidence.judged_page import TEMPLATES, JudgedDocument
from structlearn.core.artefacts import Metrics, read_csv, read_metrics, write_csv, write_metrics
from structlearn.core.publication import publish
from structlearn.reporting.document import UNKNOWN_COMMIT, Table, render, source_commit

RESULTS = Path("reports/reliability")
BROKEN_BY = ("src", "stages", "tests/faults")
"""Sources that the numbers depend on."""

SUMMED_BY = {
    "faults": ["file", "checksums"],
    "crashes": ["work"],
    "kills": ["killed", "outputs"],
    "upsets": ["reading"],
}
"""By table, columns that its sums are shown by; all its other numbers are counts."""


def keep(name: str, table: pd.DataFrame, command: str, metrics: Metrics, folder: Path = RESULTS) -> None:
    """Keep what a command found, with the commit of the code that it broke, and make the page again.

    The table, one of `SUMMED_BY`, has columns in words, then counts; the metric `broken` says how often the
    rule was broken.
    """
    path = folder / "metrics.json"
    known = read_metrics(path) if path.exists() else {}
    others = {key: value for key, value in known.items() if not key.startswith(f"{name}_")}
    made = {"command": command, "commit": source_commit(BROKEN_BY)}
    own = {f"{name}_{key}": value for key, value in (made | metrics).items()}
    found = others | own
    write_csv(table, folder / f"{name}.csv")
    write_metrics({key: found[key] for key in sorted(found)}, path)
    tables = {one: folder / f"{one}.csv" for one in SUMMED_BY}
    shown = {one: read_csv(file) for one, file in tables.items() if file.exists()}
    with publish(folder / "index.html") as page:
        page.write_text(reliability_page(shown, found), encoding="utf-8")


def outcome_table(rows: Sequence[tuple], names: Sequence[str], outcomes: Sequence[str]) -> pd.DataFrame:
    """Of rows of words, outcome and count: a row per combination of words, a column per outcome."""
    table = pd.DataFrame(rows, columns=[*names, "outcome", "count"])
    counts = table.pivot_table(index=list(names), columns="outcome", values="count", fill_value=0)
    counts = counts.reindex(columns=list(outcomes), fill_value=0).astype(int)
    return counts.rename_axis(None, axis=1).reset_index()


def reliability_page(tables: Mapping[str, pd.DataFrame], metrics: Metrics) -> str:
    """The page on the tables of `keep` as HTML; what was not run is said to be so."""
    facts = {
        name: {
            "commit": UNKNOWN_COMMIT,
            "sums": Table(_sums(tables[name], by)),
            "rows": Table(tables[name]),
            **{
                key.removeprefix(f"{name}_"): its
                for key, its in metrics.items()
                if key.startswith(f"{name}_")
            },
        }
        if name in tables
        else None
        for name, by in SUMMED_BY.items()
    }
    return render(JudgedDocument("reliability.html.jinja", TEMPLATES, facts=facts), figures={})


def _sums(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Counts summed over all other columns in words; those of nothing but 0 are left out."""
    counts = table.groupby(list(by), sort=False).sum(numeric_only=True).reset_index()
    return counts.loc[:, [name in by or counts[name].any() for name in counts]]
