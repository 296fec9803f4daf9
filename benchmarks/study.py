"""Run studies: each variant and repeat an experiment of DVC.

    python benchmarks/study.py [NAME ...]           all studies where none is named
    python benchmarks/study.py --check [NAME ...]   part of one cell again, of those that have been run

Each experiment runs in a directory of its own (`dvc exp run --temp`), so the workspace stays as it is; it
is kept by name for `dvc exp show`, `dvc exp diff` and `dvc exp apply`. The name holds a digest of what it
was made with: what has been run with this code and these parameters is not run again, so a study goes on
where it was stopped. Writes `reports/studies`; `--check` writes only what came of it into `study.json`.
"""

import argparse
import copy
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from fnmatch import fnmatch
from io import StringIO
from pathlib import Path
from typing import Annotated, Any

import dvc.api
import pandas as pd
import yaml
from dvc.dependency.param import ParamsDependency
from dvc.repo import Repo
from pydantic import Field, PositiveFloat
from tqdm import tqdm

from structlearn.core.artefacts import Metrics, publish, read_metrics, write_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, Population, checked, read_parameters, read_values
from structlearn.reporting.document import Document, render, source_commit
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.studies import (
    RESULTS,
    Made,
    Rerun,
    Study,
    covered,
    digests,
    provenance,
    read_study,
    stored_study,
)

PARAMETERS = Path("params.yaml")
CODE = ("src", "stages")
"""Folders of all sources."""


DESCRIPTIONS = Path("benchmarks/studies")


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


def main() -> None:
    """Run what is missing, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="e.g. scraping/people; default all")
    parser.add_argument("--check", action="store_true", help="run part of a cell again")
    given = parser.parse_args()
    different = []
    try:
        for name in given.names or study_names():
            if not given.check:
                run_study(name)
            different += check_study(name)
        found = {
            name: (read_description(name), stored_study(RESULTS / name))
            for name in study_names()
            if (RESULTS / name / "study.json").exists()
        }
    except InputError as error:
        sys.exit(f"error: {error}")
    with publish(RESULTS / "index.html") as path:
        path.write_text(studies_page(found), encoding="utf-8")
    print(f"{RESULTS}/index.html is up to date")
    if different:
        sys.exit(f"error: the present code gives other numbers: {', '.join(different)}")


def run_study(name: str) -> None:
    """Run the experiments of one study that are missing, and write its table."""
    description = read_description(name)
    keys = upstream_parameters(description.target)
    if isinstance(description.repeats, OverPopulation):
        keys.add(description.repeats.population)
    made_with = digests(PARAMETERS, sorted(keys))
    known = set(_output(["dvc", "exp", "list", "--all-commits", "--name-only"]).split())
    work = [
        (variant, number, changes | repeated)
        for variant, changes in description.variants.items()
        for number, repeated in enumerate(repeats(description, PARAMETERS))
    ]
    rows = []
    for variant, number, changes in tqdm(work, desc=name):
        experiment = f"{name.replace('/', '-')}-{_digest(made_with, changes)}"
        if experiment not in known:
            run_experiment(experiment, description.target, changes)
        rows.append({"variant": variant, "repeat": number, **numbers(experiment, description)})
    table = pd.DataFrame(rows)
    part = run_part(name, description) if description.rerun else {}
    made = Made(
        parameters=made_with,
        commit=source_commit(CODE),
        processor=processor(),
        added={},
        beside={key: float(value) for key, value in part.items() if key not in table},
        rerun=None,
    )
    write_study(table, made, RESULTS / name)


def upstream_parameters(target: str) -> set[str]:
    """Keys of `params.yaml` that a stage and all before it depend on."""
    stages = Repo().stage.collect(target, with_deps=True)
    deps = [dep for stage in stages if stage.name != "code" for dep in stage.deps]
    own = {key for dep in deps if isinstance(dep, ParamsDependency) for key in dep.params}
    files = [Path(dep.def_path) for dep in deps]  # some of `code` have parameters that stages share
    shared = {path.stem for path in files if path.match("data/code/main/*.yaml")}
    return {key.split(".")[0] for key in own | shared}


def check_study(name: str) -> list[str]:
    """Run part of one cell again and write what came of it.

    Returns:
        Numbers that differ, `study: number`; none where the study was not run, or with other parameters.
    """
    description, study = read_description(name), read_study(name)
    if study is None or description.rerun is None:
        return []
    again = compare(run_part(name, description), study, description)
    write_made(study.made.model_copy(update={"rerun": again}), RESULTS / name)
    print(f"{name}: {again.compared - len(again.different)} of {again.compared} numbers are equal")
    return [f"{name}: {key}" for key in again.different]


def run_experiment(experiment: str, target: str, changes: Changes) -> None:
    """Bring a stage up to date with some parameters changed."""
    options = [word for key, value in changes.items() for word in ("-S", f"{key}={json.dumps(value)}")]
    _output(["dvc", "exp", "run", "--temp", "--name", experiment, *options, target])


def numbers(experiment: str, description: Description) -> dict[str, float]:
    """The numbers of an experiment that its study keeps."""
    found: dict[str, float] = {}
    for path in description.reads:
        text = dvc.api.read(path, repo=".", rev=experiment)
        table = path.endswith("findings.csv")
        values = values_by_key(read_findings(StringIO(text))) if table else json.loads(text)
        for key, value in values.items():
            if isinstance(value, (int, float)) and any(fnmatch(key, pattern) for pattern in description.keys):
                found[key] = float(value)
    return found


def _digest(made_with: dict[str, str], changes: Changes) -> str:
    """Of code, parameters and changes; what is not committed counts as changed code."""
    code = _output(["git", "rev-parse", *(f"HEAD:{folder}" for folder in CODE)])
    code += _output(["git", "diff", "HEAD", "--", *CODE])
    everything = json.dumps([code, made_with, changes], sort_keys=True)
    return hashlib.md5(everything.encode()).hexdigest()[:10]


def _output(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
