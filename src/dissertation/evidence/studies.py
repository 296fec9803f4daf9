"""Studies: results for larger populations than one run of the pipeline, kept in git for pages.

The pipeline `stages/studies/dvc.yaml` makes them cell by cell: a cell runs a testbed's stages with other
seeds for its people or robots (`dissertation.evidence.study_cells`). This module holds what pages need:
`reports/studies/<study>` has the results of all cells (`dissertation.evidence.results`) and `study.json` with
their parameters and each cell's commit. A page counts rows that were found with its own parameters.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.artefacts import read_metrics, read_table
from structlearn.core.params import Parameters, ParametersType, checked
from structlearn.reporting.prose import counted, listing

RESULTS = Path("reports/studies")
OURS = "ours"  # variant with the pipeline's parameters
KEYS = ["variant", "cell"]  # first columns of a study's results
TABLE = "results.parquet"


class Origin(Parameters):
    """What a cell was made by."""

    commit: str
    code: str  # digest of all that it uses, see `study_cells.code_of`; empty if unknown
    processor: str  # empty if unknown
    minutes: float | None  # that it took; None if unknown
    at_once: int = 1  # cells that ran at the same time, itself included, which share the cores


class Check(Parameters):
    """Result of running one cell again."""

    cell: str
    commit: str  # of the code
    compared: int  # numbers
    different: list[str]  # quantities with differences


class StudyProvenance(Parameters):
    """Provenance of a study, the content of `study.json`."""

    parameters: dict[str, str]  # digests by key of `params.yaml`, see `digests`
    seeds: list[str]  # parameters that vary by cell, which the digests leave out
    cells: dict[str, Origin]
    check: Check | None  # None until a cell was run again

    @property
    def commits(self) -> list[str]:
        """Commits that made its cells, sorted; what cells use is the same in all."""
        return sorted({origin.commit for origin in self.cells.values()})

    @property
    def minutes_each(self) -> float:
        """Mean of the minutes that cells took, NaN if it is unknown."""
        known = [origin.minutes for origin in self.cells.values() if origin.minutes is not None]
        return sum(known) / len(known) if known else float("nan")

    @property
    def at_once(self) -> list[int]:
        """How many cells ran at the same time, each number once."""
        return sorted({origin.at_once for origin in self.cells.values()})

    @property
    def code(self) -> set[str]:
        """Digests of the code that made its cells."""
        return {origin.code for origin in self.cells.values()}


UNKNOWN = StudyProvenance(parameters={}, seeds=[], cells={}, check=None)  # for tables made up by tests


@dataclass(frozen=True)
class Study:
    """Results of a study."""

    results: pd.DataFrame  # as of one run, below the columns `KEYS`
    made: StudyProvenance = UNKNOWN


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


def stored(path: Path, made: type[ParametersType]) -> tuple[pd.DataFrame, ParametersType]:
    """Results beside a provenance file, and that file's content. Raises as `stored_study`."""
    return read_table(path.with_name(TABLE), KEYS), checked(read_metrics(path), made, path, path.stem)


def read_study(name: str, folder: Path = RESULTS) -> Study | None:
    """Read a study whatever its parameters; None if it was not run. Raises as `stored_study`."""
    return stored_study(folder / name) if (folder / name / "study.json").exists() else None


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
    return f"{words}; cell {again.cell} repeated by {again.commit}: {again.compared} numbers, {outcome}"


def rests_on(name: str, study: Study | None) -> str:
    """Sentence on a study's provenance, to precede a table of verdicts; empty if it was not run."""
    return (
        "" if study is None else f"Verdicts over populations rest on the study {name}, {provenance(study)}."
    )
