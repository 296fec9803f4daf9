"""Rows of the tables in which a report holds the dissertation's statements against what it finds."""

from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE

Row = tuple[str, str, str, str]
"""Statement, source, what is found here, whether it holds."""

HOLDS = {BETTER: "yes", WORSE: "no", UNDECIDED: UNDECIDED}
"""Whether a statement holds, by the verdict on the gain that it states."""
