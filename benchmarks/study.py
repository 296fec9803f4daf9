"""Run studies: each variant and repeat an experiment of DVC.

    python benchmarks/study.py [NAME ...]           all studies where none is named
    python benchmarks/study.py --check [NAME ...]   part of one cell again, of those that have been run

Each experiment runs in a directory of its own (`dvc exp run --temp`), so the workspace stays as it is; it
is kept by name for `dvc exp show`, `dvc exp diff` and `dvc exp apply`. The name holds a digest of what it
was made with: what has been run with this code and these parameters is not run again, so a study goes on
where it was stopped. Writes `reports/studies`; `--check` writes only what came of it into `study.json`.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from fnmatch import fnmatch
from io import StringIO
from pathlib import Path

import dvc.api
import pandas as pd
from dvc.dependency.param import ParamsDependency
from dvc.repo import Repo
from tqdm import tqdm

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.reporting.document import source_commit
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.studies import (
    RESULTS,
    Changes,
    Description,
    Made,
    OverPopulation,
    compare,
    digests,
    processor,
    read_description,
    read_study,
    repeats,
    run_part,
    stored_study,
    studies_page,
    study_names,
    write_made,
    write_study,
)

PARAMETERS = Path("params.yaml")
CODE = ("src", "stages")
"""Folders of all sources."""


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
    deps = (dep for stage in stages for dep in stage.deps if isinstance(dep, ParamsDependency))
    return {key.split(".")[0] for dep in deps for key in dep.params}


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
