"""Studies: trials beside the pipeline, each an experiment of DVC that anyone can run (`make study NAME=...`).

What a study varies is data, `benchmarks/studies/<testbed>/<name>.yaml`; `benchmarks/study.py` runs it and
leaves `reports/studies/<testbed>/<name>/table.csv`, one row per variant and repeat, with `study.json`
beside it. Pages quote the table. It says with which parameters it was made: with others, what it found says
nothing of what a page shows, so it is as good as not run.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field, PositiveFloat

from structlearn.ground.artefacts import publish, read_csv, read_metrics, write_csv, write_metrics
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters, checked, read_parameters, read_values
from structlearn.ground.populations import Population
from structlearn.reporting.claims import mean
from structlearn.reporting.document import Document, Table, render
from structlearn.reporting.prose import interval, rounded

DESCRIPTIONS = Path("benchmarks/studies")
RESULTS = Path("reports/studies")
Changes = dict[str, Any]
"""Parameters by their dotted key, with the values that they are set to."""


class OverPopulation(Parameters):
    """Repeats over the test seeds of a population.

    Attributes:
        population: its key in `params.yaml`.
        seeds: keys of the parameters that each of its seeds is given to.
    """

    population: str
    seeds: list[str] = Field(min_length=1)


class Description(Parameters):
    """What a study varies.

    Attributes:
        question: that it answers.
        target: stage that is brought up to date in each experiment.
        reads: flat JSON files of numbers that are in the repository then.
        keys: of these numbers, with wildcards.
        shown: those in the page's table, in words.
        variants: by name, what is changed.
        repeats: likewise; every variant is run with each of them, for the interval.
        minutes: that all of it took on two cores.
    """

    question: str
    target: str
    reads: list[str] = Field(min_length=1)
    keys: list[str] = Field(min_length=1)
    shown: dict[str, str] = Field(min_length=1)
    variants: dict[str, Changes] = Field(min_length=1)
    repeats: OverPopulation | Annotated[list[Changes], Field(min_length=1)]
    minutes: PositiveFloat


@dataclass(frozen=True)
class Study:
    """What a study found.

    Attributes:
        table: `variant`, `repeat`, then a column per number.
    """

    table: pd.DataFrame

    def values(self, variant: str, key: str) -> np.ndarray:
        """One number of a variant, (N,) by repeat, in order: values of two variants are pairs."""
        return self.table.loc[self.table["variant"] == variant, key].to_numpy(float)

    def summary(self, columns: Mapping[str, str]) -> Table:
        """A row per variant: mean over repeats, with its interval where there are two or more.

        Args:
            columns: what stands above them, by key.
        """
        rows = []
        for variant, part in self.table.groupby("variant", sort=False):
            row = {"variant": variant, "n": len(part)}
            for key, heading in columns.items():
                found = mean(part[key].dropna().to_numpy(float))
                text = rounded(found.value, ".3g")
                row[heading] = text if found.n < 2 else f"{text} {interval(found.low, found.high, '.3g')}"
            rows.append(row)
        return Table(pd.DataFrame(rows))


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
    """Keys of `params.yaml` that a stage and all before it depend on.

    Args:
        pipeline: the content of `dvc.yaml`.
        target: a stage of it.
    """
    stages = pipeline["stages"]
    made_by = {_path(out): name for name, stage in stages.items() for out in _outs(stage)}
    keys, waiting, seen = set(), [target], set()
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            keys |= {str(key).split(".")[0] for key in stages[name].get("params", [])}
            waiting += [maker for dep in stages[name].get("deps", []) for maker in _makers(dep, made_by)]
    return sorted(keys)


def digests(parameters: Path, keys: list[str]) -> dict[str, str]:
    """A digest of each key's value, `absent` where there is none; the order within mappings is no matter."""
    values = read_values(parameters)
    return {
        key: hashlib.md5(json.dumps(values[key], sort_keys=True).encode()).hexdigest()
        if key in values
        else "absent"
        for key in keys
    }


def write_study(table: pd.DataFrame, made_with: Mapping[str, str], folder: Path) -> None:
    """Write what a study found, with the digests of the parameters that it was made with."""
    with publish(folder) as target:
        target.mkdir()
        write_csv(table, target / "table.csv")
        write_metrics(dict(made_with), target / "study.json")


def read_study(name: str, folder: Path = RESULTS, parameters: Path = Path("params.yaml")) -> Study | None:
    """What a study found; None where it was not run, or with other parameters than these.

    Args:
        name: e.g. `scraping/people`.
        folder: of all results.
        parameters: the file whose values it must have been made with.
    """
    made = Path(folder, name)
    if not (made / "study.json").exists():
        return None
    made_with = read_metrics(made / "study.json")
    if made_with != digests(parameters, list(made_with)):
        return None
    return Study(read_csv(made / "table.csv"))


def studies_page(studies: Mapping[str, tuple[Description, pd.DataFrame]]) -> str:
    """The page of all studies as HTML, from descriptions and tables by name."""
    tables = {name: Study(table).summary(description.shown) for name, (description, table) in studies.items()}
    facts = {"studies": {name: description for name, (description, _) in studies.items()}, "shown": tables}
    document = Document("studies.html.jinja", "structlearn.reporting", facts=facts, simulated=True)
    return render(document, figures={})


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
