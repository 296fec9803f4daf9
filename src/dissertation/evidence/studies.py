"""Studies: results for larger populations than one run of the pipeline, kept as tables in git for pages.

The pipeline `stages/studies/dvc.yaml` makes them cell by cell: a cell runs a testbed's stages with other
seeds for its people or robots (`dissertation.evidence.study_tables`). This module holds what pages need:
`reports/studies/<study>` has the tables of all cells and `study.json` with their parameters and each cell's
commit. A study with parameters other than the page's counts as not run.
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

from structlearn.core.artefacts import read_csv, read_metrics, read_table
from structlearn.core.params import Parameters, ParametersType, checked, read_values
from structlearn.reporting.prose import counted, listing

RESULTS = Path("reports/studies")
OURS = "ours"  # variant with the pipeline's parameters
KEYS = ["variant", "cell"]  # first columns of a study's tables


class Origin(Parameters):
    """Commit and processor that produced a cell."""

    commit: str
    processor: str  # empty if unknown


class Check(Parameters):
    """Result of running one cell again."""

    cell: str
    commit: str  # of the code
    processor: str
    exact: bool  # whether all digits were compared; otherwise within `study_tables.TOLERANCE`
    compared: int  # numbers
    different: list[str]  # tables and columns with differences


class StudyProvenance(Parameters):
    """Provenance of a study, the content of `study.json`."""

    parameters: dict[str, str]  # digests by key of `params.yaml`, see `digests`
    seeds: list[str]  # parameters that vary by cell, which the digests leave out
    cells: dict[str, Origin]
    check: Check | None  # None until a cell was run again


UNKNOWN = StudyProvenance(parameters={}, seeds=[], cells={}, check=None)  # for tables made up by tests


@dataclass(frozen=True)
class Study:
    """Results of a study."""

    tables: Mapping[str, pd.DataFrame]  # by name, each starting with the columns `KEYS`
    made: StudyProvenance = UNKNOWN

    @property
    def table(self) -> pd.DataFrame:
        """Findings with one row per variant and cell, for studies that gather `findings.csv`."""
        return self.tables["findings"]

    def values(self, variant: str, key: str) -> np.ndarray:
        """One finding of a variant by cell, (N,); all variants have the same order of cells."""
        return self.table[key].to_numpy(float)[self._rows.get(variant, [])]

    @cached_property
    def _rows(self) -> dict[Hashable, np.ndarray]:
        return self.table.groupby("variant").indices


@dataclass(frozen=True)
class People:
    """Findings by person, from a study that runs all of a testbed for each person."""

    study: Study | None  # None if it was not run with these parameters
    variant: str

    def numbers(self, key: str) -> np.ndarray | None:
        """Values (P,) of one finding by person; None if unknown."""
        return self.study.values(self.variant, key) if self.study and key in self.study.table else None

    @property
    def count(self) -> int:
        """Number of people; 0 if the study was not run."""
        return len(self.study.values(self.variant, "cell")) if self.study else 0


def digests(values: Mapping[str, Any], keys: Sequence[str], seeds: Sequence[str]) -> dict[str, str]:
    """Digest of each parameter without the seeds and independent of order; `absent` if there is none."""

    def kept(value: Any, key: str) -> Any:
        if key in seeds:
            return None
        if isinstance(value, Mapping):
            return {name: kept(one, f"{key}.{name}") for name, one in value.items()}
        return value

    texts = {key: json.dumps(kept(values[key], key), sort_keys=True) for key in keys if key in values}
    return {key: hashlib.md5(texts[key].encode()).hexdigest() if key in texts else "absent" for key in keys}


def stored_study(folder: Path) -> Study:
    """Read a study whatever its parameters.

    Raises InputError: a file is missing, damaged or lacks its commit.
    """
    return Study(*stored(folder / "study.json", StudyProvenance))


def stored(path: Path, made: type[ParametersType]) -> tuple[dict[str, pd.DataFrame], ParametersType]:
    """Tables beside a provenance file, by name, and that file's content. Raises as `stored_study`."""
    texts = dict.fromkeys(KEYS, str)
    tables = {table.stem: read_csv(table, dtype=texts) for table in sorted(path.parent.glob("*.csv"))}
    tables |= {table.stem: read_table(table, KEYS) for table in path.parent.glob("results.parquet")}
    return tables, checked(read_metrics(path), made, path, path.stem)


def read_study(name: str, folder: Path = RESULTS, parameters: Path = Path("params.yaml")) -> Study | None:
    """Read a study; None if it was not run with the parameters in this file."""
    if not Path(folder, name, "study.json").exists():
        return None
    study = stored_study(Path(folder, name))
    known = study.made.parameters
    return study if known == digests(read_values(parameters), list(known), study.made.seeds) else None


def extended(own: pd.DataFrame, study: Study | None, name: str, key: str = "seed") -> pd.DataFrame:
    """Extend a table of this run by a study's rows with other seeds (column `key`), in the same types."""
    if study is None:
        return own
    more = study.tables[name]
    more = more.loc[~more[key].isin(own[key]), own.columns]
    texts = list(own.select_dtypes(["object", "string"]))
    more = more.astype(dict.fromkeys(texts, object)).fillna(dict.fromkeys(texts, ""))  # CSV reads "" as NaN
    return pd.concat([own, more.astype(own.dtypes)], ignore_index=True)


def provenance(study: Study) -> str:
    """Provenance as text, e.g. `made by commit a319e1d; cell 13 repeated by b9b799a: 92 numbers, equal`."""
    made = study.made
    if not made.cells:
        return "made by unknown code, not repeated since"
    by_commit: dict[str, list[str]] = {}
    for cell, origin in made.cells.items():
        by_commit.setdefault(origin.commit, []).append(cell)
    parts = {
        commit: f" ({counted(len(cells), 'cell')}: {' to '.join(dict.fromkeys((cells[0], cells[-1])))})"
        for commit, cells in by_commit.items()
    }
    words = "made by commit " + listing(
        commit + part if len(parts) > 1 else commit for commit, part in parts.items()
    )
    again = made.check
    if again is None:
        return f"{words}, not repeated since"
    outcome = f"{', '.join(again.different)} differ" if again.different else "equal"
    if not again.exact and not again.different:
        outcome = "on average within 5 % of a standard deviation on another processor"
    return f"{words}; cell {again.cell} repeated by {again.commit}: {again.compared} numbers, {outcome}"


def rests_on(name: str, study: Study | None) -> str:
    """Sentence on a study's provenance, to precede a table of verdicts; empty if it was not run."""
    return (
        "" if study is None else f"Verdicts over populations rest on the study {name}, {provenance(study)}."
    )
