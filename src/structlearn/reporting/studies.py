"""Studies: populations that one run of the pipeline is too short for, as tables in git that pages read.

The pipeline `stages/studies/dvc.yaml` makes them cell by cell: a cell is some people or robots, with whose
seeds the stages of a testbed run anew (`structlearn.reporting.study_cells`). Here is what pages need:
`reports/studies/<study>` holds the tables of all cells and `study.json`, which says with which parameters
they were made, and each cell by which commit. With other parameters, what was found says nothing of what a
page shows, so the study is as good as not run.
"""

import hashlib
import json
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import read_csv, read_metrics
from structlearn.core.params import Parameters, checked, read_values
from structlearn.reporting.prose import counted, listing

RESULTS = Path("reports/studies")
OURS = "ours"
"""The variant of a study with the parameters of the pipeline."""

KEYS = ["variant", "cell"]
"""First columns of a study's tables."""


class Origin(Parameters):
    """Whose code made a cell, and where."""

    commit: str
    processor: str  # empty where that was not kept


class Check(Parameters):
    """What came of running one cell again."""

    cell: str
    commit: str  # of the code that ran it
    processor: str  # that it ran on
    exact: bool  # whether all digits were compared; else within `study_cells.TOLERANCE`
    compared: int  # numbers
    different: list[str]  # tables and columns in which some differ


class Made(Parameters):
    """How a study was made, as `study.json` holds it."""

    parameters: dict[str, str]  # digests by key of `params.yaml`, see `digests`
    seeds: list[str]  # parameters that cells have values of their own for, which no digest counts
    cells: dict[str, Origin]
    check: Check | None  # None before a cell was run again


@dataclass(frozen=True)
class Study:
    """Results of a study."""

    tables: Mapping[str, pd.DataFrame]  # by name, each with the columns `KEYS` first
    made: Made | None = None  # how; None in tests

    @property
    def table(self) -> pd.DataFrame:
        """Numbers of people, a row for each variant and cell, of a study that gathers `findings.csv`."""
        return self.tables["findings"]

    def values(self, variant: str, key: str) -> np.ndarray:
        """One number of a variant, (N,) by cell, in order: values of two variants are pairs."""
        return self.table[key].to_numpy(float)[self._rows.get(variant, [])]

    @cached_property
    def _rows(self) -> dict[Hashable, np.ndarray]:
        return self.table.groupby("variant").indices


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
        return len(self.study.values(self.variant, "cell")) if self.study else 0


def digests(values: Mapping[str, Any], keys: Sequence[str], seeds: Sequence[str]) -> dict[str, str]:
    """A digest of each key's value without the seeds, `absent` where there is none.

    The order within mappings is no matter.
    """
    found = {}
    for key in keys:
        text = json.dumps(_without(values[key], key, set(seeds)), sort_keys=True) if key in values else ""
        found[key] = hashlib.md5(text.encode()).hexdigest() if text else "absent"
    return found


def _without(value: Any, key: str, seeds: set[str]) -> Any:
    """A value of parameters, with None for those whose dotted key is one of `seeds`."""
    if key in seeds:
        return None
    if isinstance(value, Mapping):
        return {name: _without(one, f"{key}.{name}", seeds) for name, one in value.items()}
    return value


def stored_study(folder: Path) -> Study:
    """A study as it was written, with whatever parameters.

    Raises InputError: a file is missing or damaged, or does not say by which commit it was made.
    """
    path = folder / "study.json"
    made = checked(read_metrics(path), Made, path, "study")
    texts = dict.fromkeys(KEYS, str)
    return Study({table.stem: read_csv(table, dtype=texts) for table in sorted(folder.glob("*.csv"))}, made)


def read_study(name: str, folder: Path = RESULTS, parameters: Path = Path("params.yaml")) -> Study | None:
    """Results of a study; None where it was not run, or with parameters of other values than in this file."""
    if not Path(folder, name, "study.json").exists():
        return None
    study = stored_study(Path(folder, name))
    assert study.made is not None
    known = study.made.parameters
    return study if known == digests(read_values(parameters), list(known), study.made.seeds) else None


def extended(own: pd.DataFrame, study: Study | None, name: str, key: str = "seed") -> pd.DataFrame:
    """A table of this run, and below it the rows of those whom only a study has.

    `key`: the column of seeds, by which rows are told apart. Returns columns and types of `own`.
    """
    if study is None:
        return own
    more = study.tables[name]
    more = more.loc[~more[key].isin(own[key]), own.columns]
    texts = list(own.select_dtypes(["object", "string"]))
    more = more.astype(dict.fromkeys(texts, object)).fillna(dict.fromkeys(texts, ""))  # CSV has no empty text
    return pd.concat([own, more.astype(own.dtypes)], ignore_index=True)


def provenance(study: Study) -> str:
    """`5 cells made by commit a319e1d, cell 13 run again by b9b799a: equal`, in words."""
    made = study.made
    if made is None:
        return "made by unknown code, not run again"
    by_commit: dict[str, list[str]] = {}
    for cell, origin in made.cells.items():
        by_commit.setdefault(origin.commit, []).append(cell)
    words = "made by commit " + listing(
        commit if len(by_commit) == 1 else f"{commit} ({counted(len(cells), 'cell')}: {_range(cells)})"
        for commit, cells in by_commit.items()
    )
    again = made.check
    if again is None:
        return f"{words}, not run again"
    outcome = f"{', '.join(again.different)} differ" if again.different else "equal"
    if not again.exact and not again.different:
        outcome = "equal within 0.1 % on another processor"
    return f"{words}; cell {again.cell} run again by {again.commit}: {again.compared} numbers, {outcome}"


def _range(cells: Sequence[str]) -> str:
    return cells[0] if len(cells) == 1 else f"{cells[0]} to {cells[-1]}"


def rests_on(name: str, study: Study | None) -> str:
    """For the head of a table of verdicts: whose code made the study, and what of it was run again.

    Empty where the study was not run.
    """
    return "" if study is None else f"Rows over people rest on the study {name}, {provenance(study)}."
