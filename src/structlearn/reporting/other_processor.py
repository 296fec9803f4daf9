"""Verdicts of a run on another processor beside those of this one.

Libraries choose their kernels by the processor, so sums are rounded otherwise, and what is trained or
simulated drifts apart. Digits of a page may follow; a verdict may at most become undecided.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.reporting.claims import UNDECIDED
from structlearn.reporting.document import Document, Table, render

KEYS = ["testbed", "statement", "case"]
SAME, DIGITS, MARGIN, FLIPPED = "same", "other digits", "undecided on one", "another verdict"
OUTCOMES = (SAME, DIGITS, MARGIN, FLIPPED)


def compared(here: Mapping[str, pd.DataFrame], there: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Hold tables of claims against each other.

    Args:
        here: `claims.csv` by testbed.
        there: of the run on another processor, likewise.

    Returns:
        `testbed`, `statement`, `case`, `here`, `there` (numbers in words), `verdict_here`, `verdict_there`,
        and `outcome`, one of `OUTCOMES`; a row that only one of them has is `another verdict`.
    """
    both = _rows(here, "here").merge(_rows(there, "there"), on=KEYS, how="outer")
    one_undecided = (both["verdict_here"] == UNDECIDED) | (both["verdict_there"] == UNDECIDED)
    known = both["verdict_here"].notna() & both["verdict_there"].notna()
    same_verdict = both["verdict_here"] == both["verdict_there"]
    outcome = np.select(
        [both["here"] == both["there"], same_verdict, one_undecided & known], [SAME, DIGITS, MARGIN], FLIPPED
    )
    return both.assign(outcome=outcome)


def other_processor_page(table: pd.DataFrame, settings: Mapping[str, str], machine: str) -> str:
    """The page as HTML.

    Args:
        table: of `compared`.
        settings: environment variables that made the machine another one.
        machine: that it ran on, in words.
    """
    counts = {outcome: int((table["outcome"] == outcome).sum()) for outcome in OUTCOMES}
    changed = table[table["outcome"].isin([MARGIN, FLIPPED])].drop(columns="outcome")
    digits = table[table["outcome"] == DIGITS][[*KEYS, "here", "there"]]
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


def _in_context(statements: pd.Series) -> pd.Series:
    """Statements that only say what differs from the one above (`… in our variant`), with that one."""
    follows = statements.str.startswith("…")
    return statements.where(~follows, statements.where(~follows).ffill() + " " + statements)


def _rows(tables: Mapping[str, pd.DataFrame], name: str) -> pd.DataFrame:
    """All rows of one side, each statement in its context: merging does not keep their order."""
    rows = pd.concat(
        table.assign(testbed=testbed, statement=_in_context(table["statement"]))
        for testbed, table in tables.items()
    ).fillna({"case": ""})
    return rows[[*KEYS, "here", "verdict"]].rename(columns={"here": name, "verdict": f"verdict_{name}"})
