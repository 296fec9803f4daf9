"""Studies: trials beside the pipeline, each an experiment of DVC that anyone can run (`make study NAME=...`).

What a study varies is data, `benchmarks/studies/<testbed>/<name>.yaml`; `benchmarks/study.py` runs it and
leaves `reports/studies/<testbed>/<name>/table.csv`, one row per variant and repeat, with `study.json`
beside it. Pages quote the table. It says with which parameters it was made: with others, what it found says
nothing of what a page shows, so it is as good as not run. It also names the commit of its code.

A whole study takes an hour. What of one cell (a variant and a repeat) can be run in 20 s is a script beside
the study's description, which writes numbers. They are held against the table, and where this has no such
number against those that were kept beside it when it was made; pages say whether they came out equal.
"""

import hashlib
import json
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import read_csv, read_metrics
from structlearn.core.params import Parameters, checked, read_values
from structlearn.reporting.claims import mean
from structlearn.reporting.document import Table
from structlearn.reporting.prose import counted, interval, listing, rounded

RESULTS = Path("reports/studies")


class Rerun(Parameters):
    """What came of running part of a cell again."""

    commit: str  # of the code that ran it
    processor: str  # that it ran on
    exact: bool  # whether all digits were compared; else within `TOLERANCE`
    covers: str  # in words
    compared: int  # numbers
    in_table: int  # of these; the others were kept beside the table
    different: list[str]  # keys of those that differ


class Made(Parameters):
    """How a study was made, as `study.json` holds it."""

    parameters: dict[str, str]  # digests by key of `params.yaml`
    commit: str  # of the code
    processor: str  # that it ran on; empty where that was not kept
    # columns of the table that were computed later for the same cells, with the commit of that code
    added: dict[str, str]
    # numbers of the part of a cell that can be run again which the table does not have
    beside: dict[str, float]
    rerun: Rerun | None  # of that part; None before it was run again


@dataclass(frozen=True)
class Study:
    """Results of a study."""

    table: pd.DataFrame  # `variant`, `repeat`, then a column per number
    made: Made | None = None  # how; None in tests

    def values(self, variant: str, key: str) -> np.ndarray:
        """One number of a variant, (N,) by repeat, in order: values of two variants are pairs."""
        return self.table[key].to_numpy(float)[self._rows.get(variant, [])]

    @cached_property
    def _rows(self) -> dict[Hashable, np.ndarray]:
        return self.table.groupby("variant").indices

    def summary(self, columns: Mapping[str, str]) -> Table:
        """A row per variant: mean over repeats and its interval, or both values where there are only two."""
        rows = []
        for variant, part in self.table.groupby("variant", sort=False):
            row = {"variant": variant, "n": len(part)}
            for key, heading in columns.items():
                values = part[key].dropna().to_numpy(float)
                found = mean(values)
                row[heading] = (
                    listing([rounded(value, ".3g") for value in values], "unknown")
                    if len(values) <= 2
                    else f"{rounded(found.value, '.3g')} {interval(found.low, found.high, '.3g')}"
                )
            rows.append(row)
        return Table(pd.DataFrame(rows))


@dataclass(frozen=True)
class People:
    """One number per person, of a study that ran all of a testbed for each: by the keys of its findings."""

    study: Study | None  # None where it was not run with these parameters
    variant: str

    def numbers(self, key: str) -> np.ndarray | None:
        """(P,) of one key; None where it is not known."""
        return self.study.values(self.variant, key) if self.study and key in self.study.table else None

    @property
    def count(self) -> int:
        """Number of people; 0 where the study was not run."""
        return len(self.study.values(self.variant, "repeat")) if self.study else 0


def digests(parameters: Path, keys: list[str]) -> dict[str, str]:
    """A digest of each key's value, `absent` where there is none; the order within mappings is no matter."""
    values = read_values(parameters)
    texts = {key: json.dumps(values[key], sort_keys=True) for key in keys if key in values}
    return {key: hashlib.md5(texts[key].encode()).hexdigest() if key in texts else "absent" for key in keys}


def stored_study(folder: Path) -> Study:
    """A study as it was written, with whatever parameters.

    Raises InputError: a file is missing or damaged, or was written before commits were kept in it.
    """
    path = folder / "study.json"
    return Study(read_csv(folder / "table.csv"), checked(read_metrics(path), Made, path, "study"))


def read_study(name: str, folder: Path = RESULTS, parameters: Path = Path("params.yaml")) -> Study | None:
    """Results of a study; None where it was not run, or with parameters of other values than in this file."""
    made = Path(folder, name)
    if not (made / "study.json").exists():
        return None
    known: Any = read_metrics(made / "study.json").get("parameters", {})
    return stored_study(made) if known == digests(parameters, list(known)) else None


def provenance(study: Study) -> str:
    """`made by commit a319e1d, part of one cell run again by b9b799a: equal`, in words."""
    made = study.made
    if made is None:
        return "made by unknown code, not run again"
    words = f"made by commit {made.commit}"
    if made.added:
        later = listing(sorted(set(made.added.values())))
        words += f" ({counted(len(made.added), 'column')} by {later})"
    again = made.rerun
    if again is None:
        return f"{words}, not run again"
    outcome = f"{len(again.different)} of {again.compared} numbers differ" if again.different else "equal"
    if not again.exact and not again.different:
        outcome = "equal within 0.1 % on another processor"
    return f"{words}, part of one cell run again by {again.commit}: {outcome}"


def covered(study: Study) -> str:
    """A sentence on what was run again, with how many numbers; empty where nothing was."""
    again = study.made.rerun if study.made else None
    if again is None:
        return ""
    beside = again.compared - again.in_table
    words = [f"{counted(again.in_table, 'number')} of the table"] if again.in_table else []
    if beside:
        words.append(f"{counted(beside, 'number')} that the table's code gives and the table lacks")
    return f"Run again: {again.covers}, compared in {listing(words)}; nothing else of the study."


def rests_on(name: str, study: Study | None) -> tuple[str, str]:
    """For the head of a table of verdicts: whose code made the study, and what of it was run again.

    Both are empty where the study was not run.
    """
    if study is None:
        return "", ""
    return f"Rows over people rest on the study {name}, {provenance(study)}.", covered(study)
