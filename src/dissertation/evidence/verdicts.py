"""Compare the verdicts of two runs, of the working tree and of a commit.

What matters is whether a verdict changes; it may at most become undecided. Rows that quote a study are the
same on both sides and are counted separately.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from dissertation.evidence.claims import UNDECIDED

KEYS = ["testbed", "set", "by", "statement", "case"]
"""Columns that identify a row; `set` is only filled in tables with several data sets."""

SAME, DIGITS, QUOTED = "same", "other digits", "quoted, not run here"
MARGIN, FLIPPED = "undecided on one", "another verdict"
OUTCOMES = (SAME, DIGITS, QUOTED, MARGIN, FLIPPED)
NO_ROW = "no such row"


def compared(here: Mapping[str, pd.DataFrame], there: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Outer join of claims tables by testbed, from this run and another.

    Returns `KEYS`, `here`, `there` (numbers as text), `verdict_here`, `verdict_there` and `outcome`, one of
    `OUTCOMES`; a row that only one of them has is `another verdict`.
    """
    both = _rows(here, "here").merge(_rows(there, "there"), on=[*KEYS, "again"], how="outer")
    verdicts = both[["verdict_here", "verdict_there"]]
    margin = verdicts.eq(UNDECIDED).any(axis=1) & verdicts.notna().all(axis=1)
    same_verdict = both["verdict_here"] == both["verdict_there"]
    quoted = same_verdict & (both["study_here"] == both["study_there"]) & (both["study_here"] != "")
    same = same_verdict & (both["here"] == both["there"])
    outcomes = [QUOTED, SAME, DIGITS, MARGIN]
    both["outcome"] = np.select([quoted, same, same_verdict, margin], outcomes, FLIPPED)
    return both.drop(columns=["again", "study_here", "study_there"])


def changes(table: pd.DataFrame) -> list[str]:
    """One line per row of `compared` whose verdict changed, `yes -> undecided`, with its numbers."""
    changed = table[table["outcome"].isin([MARGIN, FLIPPED])].astype(object)
    changed = changed.where(changed.notna(), NO_ROW)
    return [
        f"{': '.join(filter(None, (one.testbed, one.set, one.statement, one.case)))}: "
        f"{one.verdict_here} -> {one.verdict_there} ({one.here} -> {one.there})"
        for one in changed.itertuples()
    ]


def _rows(tables: Mapping[str, pd.DataFrame], name: str) -> pd.DataFrame:
    """All rows of one side, with columns named for it."""
    parts = [table.assign(testbed=testbed) for testbed, table in tables.items()]
    named = [*KEYS, "study"]
    rows = (pd.concat(parts) if parts else pd.DataFrame()).reindex(columns=[*named, "here", "verdict"])
    rows = rows.astype(object).fillna(dict.fromkeys(named, ""))
    rows["again"] = rows.groupby(KEYS).cumcount()  # numbers rows with equal keys
    return rows.rename(columns={"here": name, "verdict": f"verdict_{name}", "study": f"study_{name}"})
