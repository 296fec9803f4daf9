"""Studies: trials beside the pipeline, each an experiment of DVC that anyone can run (`make study NAME=...`).

What a study varies is data, `benchmarks/studies/<testbed>/<name>.yaml`; `benchmarks/study.py` runs it and
leaves `reports/studies/<testbed>/<name>/table.csv`, one row per variant and repeat, with `study.json`
beside it. Pages quote the table. It says with which parameters it was made: with others, what it found says
nothing of what a page shows, so it is as good as not run. It also names the commit of its code.

A whole study takes an hour. What of one cell (a variant and a repeat) can be run in 20 s is a script beside
the study's description, which writes numbers. They are held against the table, and where this has no such
number against those that were kept beside it when it was made; pages say whether they came out equal.
"""

import copy
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import yaml
from pydantic import Field, PositiveFloat

from structlearn.core.artefacts import Metrics, publish, read_csv, read_metrics, write_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, Population, checked, read_parameters, read_values
from structlearn.reporting.claims import mean
from structlearn.reporting.document import Document, Table, render, source_commit
from structlearn.reporting.prose import counted, interval, listing, rounded

DESCRIPTIONS = Path("benchmarks/studies")
RESULTS = Path("reports/studies")

TOLERANCE = 1e-3
"""Relative; on a processor of another kind than the table's, whose kernels round in another order."""

Changes = dict[str, Any]
"""Parameters by their dotted key, with the values that they are set to."""


class OverPopulation(Parameters):
    """Repeats over the test seeds of a population."""

    population: str  # its key in `params.yaml`
    seeds: list[str] = Field(min_length=1)  # keys of the parameters that each of its seeds is given to


class PartOfCell(Parameters):
    """What of one cell can be run again in 20 s, by the script beside the description."""

    variant: str
    repeat: int = Field(ge=0)  # from 0
    covers: str  # in words


class Description(Parameters):
    """Variants of a study."""

    question: str
    target: str  # stage that is brought up to date in each experiment
    reads: list[str] = Field(min_length=1)  # flat JSON files of numbers that are in the repository then
    keys: list[str] = Field(min_length=1)  # of these numbers, with wildcards
    shown: dict[str, str] = Field(min_length=1)  # those in the page's table, in words
    variants: dict[str, Changes] = Field(min_length=1)  # by name, what is changed
    # likewise; every variant is run with each of them, for the interval
    repeats: OverPopulation | Annotated[list[Changes], Field(min_length=1)]
    minutes: PositiveFloat  # that all of it took on two cores
    rerun: PartOfCell | None = None  # None where no number of it can be had in 20 s


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
        """A row per variant: mean over repeats, with its interval where there are two or more."""
        rows = []
        for variant, part in self.table.groupby("variant", sort=False):
            row = {"variant": variant, "n": len(part)}
            for key, heading in columns.items():
                found = mean(part[key].dropna().to_numpy(float))
                text = rounded(found.value, ".3g")
                row[heading] = text if found.n < 2 else f"{text} {interval(found.low, found.high, '.3g')}"
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


def read_description(name: str, folder: Path = DESCRIPTIONS) -> Description:
    """A study by its name, e.g. `scraping/people`.

    Raises InputError: there is no such study, or a key is missing, unknown or stands twice.
    """
    path = Path(folder, f"{name}.yaml")
    if not path.exists():
        raise InputError(f"{path}: no such study; there are {', '.join(study_names(folder))}")
    return checked(read_values(path), Description, path, "study")


def study_names(folder: Path = DESCRIPTIONS) -> list[str]:
    """All studies, e.g. `scraping/people`."""
    return sorted(path.relative_to(folder).with_suffix("").as_posix() for path in folder.glob("*/*.yaml"))


def repeats(description: Description, parameters: Path) -> list[Changes]:
    """What is changed in each repeat.

    Raises InputError: the parameters do not name its population.
    """
    if isinstance(description.repeats, list):
        return description.repeats
    over = description.repeats
    seeds = read_parameters(parameters, over.population, Population).test
    return [dict.fromkeys(over.seeds, seed) for seed in seeds]


def digests(parameters: Path, keys: list[str]) -> dict[str, str]:
    """A digest of each key's value, `absent` where there is none; the order within mappings is no matter."""
    values = read_values(parameters)
    texts = {key: json.dumps(values[key], sort_keys=True) for key in keys if key in values}
    return {key: hashlib.md5(texts[key].encode()).hexdigest() if key in texts else "absent" for key in keys}


def write_study(table: pd.DataFrame, made: Made, folder: Path) -> None:
    """Write what a study found, and how it was made."""
    with publish(folder) as target:
        target.mkdir()
        write_csv(table, target / "table.csv")
        write_made(made, target)


def write_made(made: Made, folder: Path) -> None:
    """Write how a study was made beside its table."""
    with publish(folder / "study.json") as path:
        path.write_text(made.model_dump_json(indent=2) + "\n", encoding="utf-8")


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


def studies_page(studies: Mapping[str, tuple[Description, Study]]) -> str:
    """The page of all studies as HTML, from descriptions and what they found by name."""
    facts = {
        "studies": {name: description for name, (description, _) in studies.items()},
        "shown": {name: study.summary(description.shown) for name, (description, study) in studies.items()},
        "provenance": {name: provenance(study) for name, (_, study) in studies.items()},
        "covered": {name: covered(study) for name, (_, study) in studies.items()},
    }
    document = Document("studies.html.jinja", "structlearn.reporting", facts=facts, simulated=True)
    return render(document, figures={})


def run_part(name: str, description: Description, root: Path = Path(".")) -> Metrics:
    """Numbers of the part of a cell that a study's description names.

    Raises InputError: the script failed.
    """
    root = root.resolve()
    cell = description.rerun
    assert cell is not None
    changes = description.variants[cell.variant] | repeats(description, root / "params.yaml")[cell.repeat]
    path = os.pathsep.join(filter(None, [str(root / "src"), os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory() as folder:
        values = copy.deepcopy(read_values(root / "params.yaml"))
        for key, value in changes.items():
            *parents, last = key.split(".")
            place = values
            for part in parents:
                place = place[part]
            place[last] = value
        Path(folder, "params.yaml").write_text(yaml.safe_dump(values), encoding="utf-8")
        script = root / DESCRIPTIONS / f"{name}.py"
        done = subprocess.run(
            [sys.executable, script],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise InputError(f"{script}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")
        return read_metrics(Path(folder, "numbers.json"))


def compare(found: Metrics, study: Study, description: Description, root: Path = Path(".")) -> Rerun:
    """Numbers that `run_part` found anew beside those of the study."""
    cell, made, here = description.rerun, study.made, processor()
    assert cell is not None
    assert made is not None
    table = study.table
    row = table[(table["variant"] == cell.variant) & (table["repeat"] == cell.repeat)].iloc[0]
    known_on = {made.processor} | ({made.rerun.processor} if made.rerun and made.rerun.exact else set())
    exact = here in known_on or known_on == {""}  # the first time, who knows: as if it were the same
    known = {key: row[key] for key in found if key in row.index} | made.beside
    return Rerun(
        commit=source_commit(root=root),
        processor=here,
        exact=exact,
        covers=cell.covers,
        compared=len(found),
        in_table=sum(key in row.index for key in found),
        different=sorted(
            key for key, value in found.items() if key not in known or not _alike(value, known[key], exact)
        ),
    )


def processor() -> str:
    """The kind of processor that compiled code is made for, which libraries choose their kernels by too."""
    from llvmlite import binding

    return os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()


def _alike(first: Any, second: Any, exact: bool) -> bool:
    if exact:  # six digits are kept
        return f"{float(first):.6g}" == f"{float(second):.6g}"
    return abs(first - second) <= TOLERANCE * max(abs(first), abs(second))
