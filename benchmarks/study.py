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
from typing import Any

import dvc.api
import pandas as pd
import yaml
from tqdm import tqdm

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.source_commit import code_digests, source_commit
from structlearn.reporting.studies import (
    CODE,
    RESULTS,
    Changes,
    Description,
    Made,
    OverPopulation,
    digests,
    read_description,
    read_study,
    repeats,
    stored_study,
    studies_page,
    study_names,
    upstream_code,
    upstream_parameters,
    write_made,
    write_study,
)
from structlearn.reporting.study_rerun import compare, processor, run_part

PARAMETERS = Path("params.yaml")


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
    pipeline = yaml.safe_load(Path("dvc.yaml").read_text(encoding="utf-8"))
    keys = upstream_parameters(pipeline, description.target)
    if isinstance(description.repeats, OverPopulation):
        keys.append(description.repeats.population)
    made_with = digests(PARAMETERS, sorted(set(keys)))
    made = made_now(made_with, pipeline, description.target)
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
    if description.rerun is not None:
        found = run_part(name, description)
        beside = {key: float(value) for key, value in found.items() if key not in table}
        made = made.model_copy(update={"beside": beside})
    write_study(table, made, RESULTS / name)


def made_now(parameters: dict[str, str], pipeline: dict[str, Any], target: str) -> Made:
    """How a study is made by the present code, before any of it was run again."""
    return Made(
        parameters=parameters,
        code=code_digests(upstream_code(pipeline, target)),
        commit=source_commit(CODE),
        processor=processor(),
        added={},
        beside={},
        rerun=None,
    )


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
