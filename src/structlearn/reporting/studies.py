"""Studies: trials beside the pipeline, each an experiment of DVC that anyone can run (`make study NAME=...`).

What a study varies is data, `benchmarks/studies/<testbed>/<name>.yaml`; `benchmarks/study.py` runs it and
leaves `reports/studies/<testbed>/<name>/table.csv`, one row per variant and repeat, with `study.json`
beside it. Pages quote the table. It says with which parameters it was made: with others, what it found says
nothing of what a page shows, so it is as good as not run. It also says by which code: with other code it is
quoted, but the page says so, and whether part of a cell came out equal when it was run again (`study_rerun`).
"""

import hashlib
import json
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field, PositiveFloat

from structlearn.core.artefacts import publish, read_csv, read_metrics, write_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, Population, checked, read_parameters, read_values
from structlearn.core.source_closure import SourceTree
from structlearn.reporting.claims import mean
from structlearn.reporting.document import Document, Table, render
from structlearn.reporting.prose import counted, interval, listing, rounded
from structlearn.reporting.source_commit import code_digests

DESCRIPTIONS = Path("benchmarks/studies")
RESULTS = Path("reports/studies")
CODE = ("src", "stages")
"""Folders of all sources."""

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
    code: dict[str, str]  # its digests, by source folder of the study
    processor: str  # that it ran on
    exact: bool  # whether all digits were compared; else within `study_rerun.TOLERANCE`
    covers: str  # in words
    compared: int  # numbers
    in_table: int  # of these; the others were kept beside the table
    different: list[str]  # keys of those that differ


class Made(Parameters):
    """How a study was made, as `study.json` holds it."""

    parameters: dict[str, str]  # digests by key of `params.yaml`
    code: dict[str, str]  # digests by source folder of its target stage and all before it
    commit: str  # of this code
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

    Raises:
        InputError: there is no such study, or a key is missing, unknown or stands twice.
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

    Raises:
        InputError: the parameters do not name its population.
    """
    if isinstance(description.repeats, list):
        return description.repeats
    over = description.repeats
    seeds = read_parameters(parameters, over.population, Population).test
    return [dict.fromkeys(over.seeds, seed) for seed in seeds]


def upstream_parameters(pipeline: Mapping[str, Any], target: str) -> list[str]:
    """Keys of `params.yaml` that a stage and all before it depend on."""
    stages = _upstream(pipeline, target)
    return sorted({str(key).split(".")[0] for stage in stages for key in stage.get("params", [])})


def upstream_code(pipeline: Mapping[str, Any], target: str, root: Path = Path(".")) -> list[str]:
    """Scripts of a stage and all before it, and the source folders of the modules that they import."""
    scripts = {stage["cmd"].split()[1] for stage in _upstream(pipeline, target)} - {"stages/list_code.py"}
    sources = SourceTree(root / "src")
    modules = {path for script in scripts for path in sources.closure(root / script)}
    depth = {"testbeds": 4}  # `structlearn/testbeds/<testbed>/world`, but `structlearn/<method>`
    folders = {Path("src", *path.parts[: depth.get(path.parts[1], 2)]) for path in modules}
    return sorted(scripts | set(map(str, folders)))


def digests(parameters: Path, keys: list[str]) -> dict[str, str]:
    """A digest of each key's value, `absent` where there is none; the order within mappings is no matter."""
    values = read_values(parameters)
    return {
        key: hashlib.md5(json.dumps(values[key], sort_keys=True).encode()).hexdigest()
        if key in values
        else "absent"
        for key in keys
    }


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

    Raises:
        InputError: a file is missing or damaged, or was written before code was kept in it.
    """
    return Study(read_csv(folder / "table.csv"), _read_made(folder))


def read_study(name: str, folder: Path = RESULTS, parameters: Path = Path("params.yaml")) -> Study | None:
    """Results of a study; None where it was not run, or with parameters of other values than in this file."""
    made = Path(folder, name)
    if not (made / "study.json").exists():
        return None
    made_with = _read_made(made).parameters
    return stored_study(made) if made_with == digests(parameters, list(made_with)) else None


def changed_code(made: Made, root: Path = Path(".")) -> list[str]:
    """Source folders that are not as they were when a study was made."""
    now = code_digests(made.code, root)
    return [folder for folder, digest in made.code.items() if digest != now[folder]]


def provenance(study: Study, root: Path = Path(".")) -> str:
    """`made by other code (commit a319e1d), part of one cell re-run on b9b799a: equal`, in words."""
    made = study.made
    if made is None:
        return "made by unknown code, not re-run"
    whose = "other" if changed_code(made, root) else "this"
    later = (
        f"; {counted(len(made.added), 'column')}: {listing(sorted(set(made.added.values())))}"
        if made.added
        else ""
    )
    words = f"made by {whose} code (commit {made.commit}{later})"
    if made.rerun is None:
        return words if whose == "this" else f"{words}, not re-run"
    again = made.rerun
    since = "" if again.code == code_digests(again.code, root) else ", before other changes of code"
    outcome = f"{len(again.different)} of {again.compared} numbers differ" if again.different else "equal"
    if not again.exact and not again.different:
        outcome = "equal within 0.1 % on another processor"
    return f"{words}, part of one cell re-run on {again.commit}{since}: {outcome}"


def covered(study: Study) -> str:
    """A sentence on what was run again, with how many numbers; empty where nothing was."""
    again = study.made.rerun if study.made else None
    if again is None:
        return ""
    beside = again.compared - again.in_table
    words = [f"{counted(again.in_table, 'number')} of the table"] if again.in_table else []
    words += (
        [f"{counted(beside, 'number')} that the table's code gives and the table lacks"] if beside else []
    )
    return f"Run again: {again.covers}, compared in {listing(words)}; nothing else of the study."


def rests_on(name: str, study: Study | None, root: Path = Path(".")) -> tuple[str, str]:
    """For the head of a table of verdicts: whose code made the study, and what of it was run again.

    Both are empty where the study was not run.
    """
    if study is None:
        return "", ""
    return f"Rows over people rest on the study {name}, {provenance(study, root)}.", covered(study)


def studies_page(studies: Mapping[str, tuple[Description, Study]], root: Path = Path(".")) -> str:
    """The page of all studies as HTML, from descriptions and what they found by name."""
    facts = {
        "studies": {name: description for name, (description, _) in studies.items()},
        "shown": {name: study.summary(description.shown) for name, (description, study) in studies.items()},
        "provenance": {name: provenance(study, root) for name, (_, study) in studies.items()},
        "covered": {name: covered(study) for name, (_, study) in studies.items()},
        "changed": {
            name: listing(changed_code(study.made, root)) if study.made else ""
            for name, (_, study) in studies.items()
        },
    }
    document = Document("studies.html.jinja", "structlearn.reporting", facts=facts, simulated=True)
    return render(document, figures={})


def _read_made(folder: Path) -> Made:
    path = folder / "study.json"
    return checked(read_metrics(path), Made, path, "study")


def _upstream(pipeline: Mapping[str, Any], target: str) -> list[Mapping[str, Any]]:
    """A stage and all before it."""
    stages = pipeline["stages"]
    made_by = {_path(out): name for name, stage in stages.items() for out in _outs(stage)}
    waiting, seen = [target], {}
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen[name] = stages[name]
            waiting += [maker for dep in stages[name].get("deps", []) for maker in _makers(dep, made_by)]
    return list(seen.values())


def _outs(stage: Mapping[str, Any]) -> list[Any]:
    return [*stage.get("outs", []), *stage.get("metrics", [])]


def _path(out: str | Mapping[str, Any]) -> str:
    return out if isinstance(out, str) else next(iter(out))


def _makers(dep: str, made_by: Mapping[str, str]) -> list[str]:
    """Stages whose outs are this dep, lie in it, or hold it."""
    at = PurePosixPath(dep)
    return [
        name
        for out, name in made_by.items()
        if at.is_relative_to(out) or PurePosixPath(out).is_relative_to(at)
    ]
