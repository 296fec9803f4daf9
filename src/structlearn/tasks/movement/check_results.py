"""What checking a skill on a robot found: margins of every quantity in every run, and verdicts.

A margin is the part of a bound that is left: 0 at the bound, negative beyond, at most 1.
"""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import Metrics, publish, read_table, write_table

NOMINAL, STARTS, GOALS, CORRECTIONS = KINDS = ("nominal", "starts", "goals", "corrections")
"""Kinds of runs."""

YES, DOUBTFUL, NO, NOT_TESTED = "yes", "doubtful", "no", "not tested"

THIN = 0.1
"""A smaller margin is doubtful: what a controller that follows adds to its reference may use it up."""

SLOWED = {"velocity": 1, "acceleration": 2, "jerk": 3}
"""Quantities that a longer duration lessens, and with which power."""


@dataclass(frozen=True)
class SkillCheck:
    """Results.

    Attributes:
        margins: a row per run and quantity: `kind`, `run`, `quantity`, `where` (joint or links), `value`,
            `bound`, `unit`, `margin`, `time_s`, `verdict`; what was not tested has no numbers.
        rest: rest configuration by joint, rad or m.
        notes: what nobody looked at, and why.
    """

    margins: pd.DataFrame
    rest: dict[str, float]
    notes: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """That of all runs."""
        return overall(self.margins["verdict"])

    @property
    def stretch(self) -> float:
        """Factor of all durations with which velocity, acceleration and jerk would keep their bounds.

        A primitive keeps its path when its duration changes, so these fall with the factor's first, second
        and third power.
        """
        share = 1.0 - self.margins.groupby("quantity")["margin"].min()
        return max(1.0, *(share[quantity] ** (1.0 / power) for quantity, power in SLOWED.items()))

    @property
    def failing(self) -> pd.DataFrame:
        """Rows of what a run does not keep."""
        return self.margins[self.margins["verdict"] == NO]

    def worst(self, *by: str) -> pd.DataFrame:
        """The row with the least margin by these columns, in the order of the runs."""
        groups = self.margins.fillna({"margin": 1.0}).groupby(list(by), sort=False)["margin"]
        return self.margins.loc[groups.idxmin()]

    def metrics(self) -> Metrics:
        """Key figures."""
        return {
            "check_verdict": self.verdict,
            "check_nominal": overall(self.margins.loc[self.margins["kind"] == NOMINAL, "verdict"]),
            "check_runs": int(self.margins["run"].nunique()),
            "check_failing_runs": int(self.failing["run"].nunique()),
            "check_least_margin": float(self.margins["margin"].min()),
            "check_stretch": float(self.stretch),
        }


def verdict(margin: float) -> str:
    """Verdict on a margin."""
    return NO if margin < 0.0 else DOUBTFUL if margin < THIN else YES


def overall(verdicts: pd.Series) -> str:
    """The worst of several: a no, else a doubt; what is not tested is a doubt."""
    found = set(verdicts)
    if NO in found:
        return NO
    return DOUBTFUL if found & {DOUBTFUL, NOT_TESTED} else YES


def write_check(check: SkillCheck, folder: str | Path) -> None:
    """Publish what was found as a folder of Parquet tables, one per attribute."""
    rest = {"joint": list(check.rest), "rest": list(check.rest.values())}
    with publish(folder) as path:
        path.mkdir()
        write_table(check.margins, path / "margins.parquet")
        write_table(pd.DataFrame(rest), path / "rest.parquet")
        write_table(pd.DataFrame({"note": pd.Series(check.notes, dtype=str)}), path / "notes.parquet")


def read_check(folder: str | Path) -> SkillCheck:
    """Read what was found.

    Raises:
        InputError: a file is missing, damaged or another one.
    """
    margins, rest, notes = (read_table(Path(folder) / f"{name}.parquet", its) for name, its in TABLES.items())
    return SkillCheck(margins, dict(zip(rest["joint"], rest["rest"], strict=True)), tuple(notes["note"]))


TABLES = {
    "margins": ("kind", "run", "quantity", "where", "value", "bound", "unit", "margin", "time_s", "verdict"),
    "rest": ("joint", "rest"),
    "notes": ("note",),
}
"""Files of a check, and their columns."""
