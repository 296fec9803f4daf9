"""Run studies: each variant and repeat an experiment of DVC.

    python benchmarks/study.py [NAME ...]        all studies where none is named

Each experiment runs in a directory of its own (`dvc exp run --temp`), so the workspace stays as it is; it
is kept by name for `dvc exp show`, `dvc exp diff` and `dvc exp apply`. The name holds a digest of what it
was made with: what has been run with this code and these parameters is not run again, so a study goes on
where it was stopped. Writes `reports/studies`.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import dvc.api
import pandas as pd
import yaml
from tqdm import tqdm

from structlearn.ground.artefacts import publish
from structlearn.ground.errors import InputError
from structlearn.reporting.studies import (
    RESULTS,
    Changes,
    Description,
    OverPopulation,
    digests,
    read_description,
    repeats,
    studies_page,
    study_names,
    upstream_parameters,
    write_study,
)

PARAMETERS = Path("params.yaml")
CODE = ("src", "stages")


def main() -> None:
    """Run what is missing, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="e.g. scraping/people; default all")
    try:
        for name in parser.parse_args().names or study_names():
            run_study(name)
    except InputError as error:
        sys.exit(f"error: {error}")
    done = {name: RESULTS / name / "table.csv" for name in study_names()}
    found = {
        name: (read_description(name), pd.read_csv(path)) for name, path in done.items() if path.exists()
    }
    with publish(RESULTS / "index.html") as path:
        path.write_text(studies_page(found), encoding="utf-8")
    print(f"{RESULTS}/index.html is up to date")


def run_study(name: str) -> None:
    """Run the experiments of one study that are missing, and write its table."""
    description = read_description(name)
    pipeline = yaml.safe_load(Path("dvc.yaml").read_text(encoding="utf-8"))
    keys = upstream_parameters(pipeline, description.target)
    if isinstance(description.repeats, OverPopulation):
        keys.append(description.repeats.population)
    made_with = digests(PARAMETERS, sorted(set(keys)))
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
    write_study(pd.DataFrame(rows), made_with, RESULTS / name)


def run_experiment(experiment: str, target: str, changes: Changes) -> None:
    """Bring a stage up to date with some parameters changed."""
    options = [word for key, value in changes.items() for word in ("-S", f"{key}={json.dumps(value)}")]
    _output(["dvc", "exp", "run", "--temp", "--name", experiment, *options, target])


def numbers(experiment: str, description: Description) -> dict[str, float]:
    """The numbers of an experiment that its study keeps."""
    found: dict[str, float] = {}
    for path in description.reads:
        values = json.loads(dvc.api.read(path, repo=".", rev=experiment))
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
