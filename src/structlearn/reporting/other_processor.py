"""Verdicts of a run on another processor beside those of this one.

Libraries choose their kernels by the processor, so sums are rounded otherwise, and what is trained or
simulated drifts apart. Digits of a page may follow; a verdict may at most become undecided. Rows that quote a
study are the same file on both sides, so they test nothing and are counted apart.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.reporting.claims import UNDECIDED
from structlearn.reporting.document import Document, Table, render

KEYS = ["testbed", "set", "by", "statement", "case"]
"""Columns that name a row; `set` only where a table has several."""

SAME, DIGITS, QUOTED = "same", "other digits", "quoted, not run here"
MARGIN, FLIPPED = "undecided on one", "another verdict"
OUTCOMES = (SAME, DIGITS, QUOTED, MARGIN, FLIPPED)
NO_ROW = "no such row"


def compared(here: Mapping[str, pd.DataFrame], there: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Tables of claims by testbed, of here and of another processor, held against each other.

    Returns:
        `KEYS`, `here`, `there` (numbers in words), `verdict_here`, `verdict_there`, and `outcome`, one of
        `OUTCOMES`; a row that only one of them has is `another verdict`, one that both quote from the same
        study is `quoted, not run here`, whatever it says.
    """
    both = _rows(here, "here").merge(_rows(there, "there"), on=[*KEYS, "again"], how="outer")
    one_undecided = (both["verdict_here"] == UNDECIDED) | (both["verdict_there"] == UNDECIDED)
    known = both["verdict_here"].notna() & both["verdict_there"].notna()
    same_verdict = both["verdict_here"] == both["verdict_there"]
    quoted = (both["study_here"] == both["study_there"]) & (both["study_here"] != "")
    both["outcome"] = np.select(
        [
            quoted & same_verdict,
            (both["here"] == both["there"]) & same_verdict,
            same_verdict,
            one_undecided & known,
        ],
        [QUOTED, SAME, DIGITS, MARGIN],
        FLIPPED,
    )
    return both.drop(columns=["again", "study_here", "study_there"])


def changes(table: pd.DataFrame) -> list[str]:
    """A line per row of `compared` whose verdict is another word, `yes -> undecided`, with its numbers."""
    changed = table[table["outcome"].isin([MARGIN, FLIPPED])].astype(object)
    changed = changed.where(changed.notna(), NO_ROW)
    return [
        f"{': '.join(filter(None, (one.testbed, one.set, one.statement, one.case)))}: "
        f"{one.verdict_here} -> {one.verdict_there} ({one.here} -> {one.there})"
        for one in changed.itertuples()
    ]


def other_processor_page(table: pd.DataFrame, settings: Mapping[str, str], machine: str) -> str:
    """The page on `compared` as HTML; settings are the variables that made the machine another one."""
    counts = {outcome: int((table["outcome"] == outcome).sum()) for outcome in OUTCOMES}
    table = table.drop(columns=[name for name in ("set", "by") if not table[name].astype(bool).any()])
    changed = table[table["outcome"].isin([MARGIN, FLIPPED])].drop(columns="outcome")
    digits = table[table["outcome"] == DIGITS].drop(columns=["outcome", "verdict_here", "verdict_there"])
    facts = {
        "counts": counts,
        "settings": settings,
        "machine": machine,
        "changed": Table(
            changed.reset_index(drop=True), headings={name: name.replace("_", " ") for name in changed}
        ),
        "digits": Table(digits.reset_index(drop=True)),
    }
    return render(
        Document("other_processor.html.jinja", "structlearn.reporting", facts=facts, simulated=True),
        figures={},
    )


def _rows(tables: Mapping[str, pd.DataFrame], name: str) -> pd.DataFrame:
    """All rows of one side."""
    named = [*KEYS, "study"]
    parts = [
        table.reindex(columns=[*dict.fromkeys([*named, *table])])
        .astype(dict.fromkeys(named, object))
        .assign(testbed=testbed)
        .fillna(dict.fromkeys(named, ""))
        for testbed, table in tables.items()
    ]
    rows = pd.concat(parts) if parts else pd.DataFrame(columns=[*named, "here", "verdict"])
    rows["again"] = rows.groupby(KEYS).cumcount()  # of rows with the same words
    kept = rows[[*KEYS, "again", "here", "verdict", "study"]]
    return kept.rename(columns={"here": name, "verdict": f"verdict_{name}", "study": f"study_{name}"})
