"""Results of checking a skill on a robot: margins of every quantity in every run, and verdicts.

A margin is the fraction of a bound that is left: 0 at the bound, negative beyond it, at most 1.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import Metrics, publish, read_table
from structlearn.core.errors import InputError
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.project import ENTRIES
from structlearn.tasks.task_files import TaskFiles, write_tables

NOMINAL, STARTS, GOALS, CORRECTIONS = KINDS = ("nominal", "starts", "goals", "corrections")  # kinds of runs
YES, DOUBTFUL, NO, NOT_TESTED = "yes", "doubtful", "no", "not tested"
THIN = 0.1  # smaller margins are doubtful: what a controller adds to its reference may use them up
SLOWED = {"velocity": 1, "acceleration": 2, "jerk": 3}  # power of the duration with which each decreases
UNCHECKED = ("ranges", "velocities", "accelerations", "jerk", "self-collisions")  # without a URDF
TRIED = ["change", "failing_runs", "still_failing", "least_margin_share"]
NOTHING_TRIED = pd.DataFrame({name: [] for name in TRIED})


@dataclass(frozen=True)
class SkillCheck:
    """Margins of all runs, and changes tried for those that fail."""

    # one row per run and quantity: `kind`, `run`, `quantity`, `where` (joint or links), `value`, `bound`,
    # `unit`, `margin`, `time_s`, `verdict`; without numbers if not tested
    margins: pd.DataFrame
    rest: dict[str, float]  # rest configuration by joint, rad or m
    notes: tuple[str, ...]  # what was not tested, and why
    # change in words, numbers of runs that failed and still do, their least margin; the last row is the
    # advice if no run fails any more
    tried: pd.DataFrame

    @property
    def verdict(self) -> str:
        """Verdict over all runs."""
        return overall(self.margins["verdict"])

    @property
    def failing(self) -> pd.DataFrame:
        """Margins below zero."""
        return self.margins[self.margins["verdict"] == NO]

    @property
    def stretch(self) -> float:
        """Factor on all durations with which velocity, acceleration and jerk would keep their bounds.

        A primitive keeps its path when its duration changes, so these decrease with the factor's first,
        second and third power. 1 if anything else fails, which slower runs would not fix.
        """
        if not set(self.failing["quantity"]) <= set(SLOWED):
            return 1.0
        share = 1.0 - self.margins.groupby("quantity")["margin"].min()
        return max(1.0, *(share[quantity] ** (1.0 / power) for quantity, power in SLOWED.items()))

    @property
    def advice(self) -> str:
        """Change that fixes all failing runs, as tried; empty if there is none."""
        mends = self.tried["change"][self.tried["still_failing"] == 0]
        return str(mends.iloc[-1]) if len(mends) else ""

    @property
    def faults(self) -> list[str]:
        """The worst of each failing quantity in words: which joint, by how much and when."""
        failing = replace(self, margins=self.failing).worst("quantity") if len(self.failing) else self.failing
        return [
            f"{row.quantity} of {row.where} is {row.value:.3g} {row.unit} at {row.time_s:.2f} s "
            f"({'correction ' * (row.kind == CORRECTIONS)}{row.run}), its bound {row.bound:.3g}"
            for row in failing.itertuples()
        ]

    def worst(self, *by: str) -> pd.DataFrame:
        """Row with the least margin for each value of these columns, in the order of the runs."""
        groups = self.margins.fillna({"margin": 1.0}).groupby(list(by), sort=False)["margin"]
        return self.margins.loc[groups.idxmin()]

    def metrics(self) -> Metrics:
        """Metrics of the check."""
        return {
            "check_verdict": self.verdict,
            "check_nominal": overall(self.margins.loc[self.margins["kind"] == NOMINAL, "verdict"]),
            "check_runs": int(self.margins["run"].nunique()),
            "check_failing_runs": int(self.failing["run"].nunique()),
            "check_least_margin": float(self.margins["margin"].min()),
            "check_stretch": float(self.stretch),
        }


def margin_verdict(margin: float) -> str:
    """Verdict on a margin."""
    return NO if margin < 0.0 else DOUBTFUL if margin < THIN else YES


def overall(verdicts: pd.Series) -> str:
    """Worst of several verdicts: no, then doubtful, which includes not tested."""
    present = set(verdicts)
    return NO if NO in present else DOUBTFUL if present & {DOUBTFUL, NOT_TESTED} else YES


def write_check(check: SkillCheck, folder: str | Path) -> None:
    """Publish a check as a folder of Parquet tables, one per attribute."""
    rest = pd.DataFrame(check.rest.items(), columns=["joint", "rest"])
    tables = vars(check) | {"rest": rest, "notes": pd.DataFrame({"note": pd.Series(check.notes, dtype=str)})}
    with publish(folder) as path:
        path.mkdir()
        write_tables(tables, path)


def read_check(folder: str | Path) -> SkillCheck:
    """Read a check. Raises InputError: a file is missing or damaged."""
    names = ("margins", "rest", "notes", "tried")
    margins, rest, notes, tried = (read_table(Path(folder) / f"{name}.parquet") for name in names)
    return SkillCheck(margins, rest.set_index("joint")["rest"].to_dict(), tuple(notes["note"]), tried)


def check_lines(check: SkillCheck) -> list[str]:
    """Text lines: the worst of each quantity, notes, faults, changes tried, and the verdict."""
    worst = check.worst("quantity").assign(margin_percent=lambda table: 100.0 * table["margin"])
    columns = ["quantity", "verdict", "margin_percent", "value", "bound", "unit", "where", "run", "time_s"]
    table = worst[columns].to_string(index=False, float_format="{:.3g}".format, na_rep="-")
    tried = [
        f"tried: {row.change}: {row.still_failing} of {row.failing_runs} runs still fail"
        for row in check.tried.itertuples()
    ]
    advice, figures = [f"advice: {check.advice}"] if check.advice else [], check.metrics()
    verdict = (
        f"{check.verdict}: {figures['check_failing_runs']} of {figures['check_runs']} runs fail; "
        f"the nominal one: {figures['check_nominal']}"
    )
    return [table, *check.notes, *check.faults, *tried, *advice, verdict]


def main(files: TaskFiles) -> bool:
    """Print the check of a task; return whether nothing fails.

    Raises InputError: the task has no robot, or was not checked.
    """
    if files.kind != "movement" or not files.has("robot"):
        entry = f"{ENTRIES}: {files.kind}.{files.name}"
        message = f"{entry} has no robot to be checked on; add `robot: {{urdf: .., tip: ..}}`"
        if files.kind == "movement" and files.entry(MovementEntry).of_joints:
            message += f"; of the joints were not checked: {', '.join(UNCHECKED)}"
        raise InputError(message)
    check = read_check(files.folder / "check")
    print("\n".join(check_lines(check)))
    return check.verdict != NO
