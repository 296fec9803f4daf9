"""Cells of studies: a testbed's stages run anew for other people or robots, over the cores or a cluster.

`stages/studies/studies.yaml` describes each study, `stages/studies/dvc.yaml` lists its cells. A cell is named
by its seeds, `13` or the range `19-26`, and writes the results of all variants of the study to
`data/studies/<study>/<cell>`. Cells are made by committed code only, all cells of a study by the same: later
commits may change what no cell uses, such as a page.
"""

import copy
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from pydantic import Field

from dissertation.evidence.results import FOLDER, read_results
from dissertation.evidence.studies import KEYS, OURS, RESULTS, TABLE, Origin, read_study
from structlearn.core.artefacts import publish, write_table
from structlearn.core.code_digests import CODE, LIBRARY, code_digests, write_code
from structlearn.core.errors import InputError
from structlearn.core.parallel import BACKEND, at_once, parallel_map
from structlearn.core.params import Parameters, checked, read_values, value_at
from structlearn.reporting.document import source_commit
from structlearn.reporting.prose import counted

DESCRIPTIONS = Path("stages/studies/studies.yaml")
REPRODUCTION = Path(__file__).parents[1]
CELLS = Path("data/studies")


class Variant(Parameters):
    """What a variant of a study changes besides the seeds."""

    parameters: dict[str, Any]  # by dotted key
    first: str  # first stage to run; results of earlier stages are those of the preceding variants


class Description(Parameters):
    """A study."""

    question: str
    seeds: list[str] = Field(min_length=1)  # parameters set to a cell's seeds, by dotted key
    stages: list[str] = Field(min_length=1)  # scripts of the testbed, in order; the last writes its results
    parameters: list[str] = Field(
        default_factory=list
    )  # keys of `params.yaml` that stages read which are of no pipeline
    variants: dict[str, Variant] = Field(default_factory=dict)  # besides the pipeline's, `OURS`


def read_descriptions(path: Path = DESCRIPTIONS) -> dict[str, Description]:
    """All studies by name, e.g. `scraping/people`. Raises InputError: a key is missing, unknown or twice."""
    return {name: checked(its, Description, path, name) for name, its in read_values(path).items()}


def seeds_of(cell: str) -> list[int]:
    """Seeds of a cell: `13` is one, `19-26` are eight. Raises InputError for other names."""
    first, _, last = cell.partition("-")
    try:
        seeds = list(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"cell {cell}: not a seed, nor a range of seeds such as 19-26") from error
    if not seeds:
        raise InputError(f"cell {cell}: no seed; {last} is below {first}")
    return seeds


def changed(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of `params.yaml` values with changes by dotted key. Raises InputError: a key is absent."""
    result = copy.deepcopy(dict(values))
    for key, value in changes.items():
        *parents, last = key.split(".")
        place = result
        for part in parents:
            place = place.get(part, {})
        if last not in place:
            raise InputError(f"params.yaml: key '{key}' is missing, which a study changes")
        place[last] = value
    return result


def run_cell(name: str, description: Description, cell: str, root: Path) -> pd.DataFrame:
    """Run the stages of a study for one cell; return its results, below the columns `KEYS`."""
    testbed, seeds, parameters = name.partition("/")[0], seeds_of(cell), root / "params.yaml"
    values = read_values(parameters)
    own = {
        key: seeds if isinstance(value_at(parameters, key), list) else seeds[0] for key in description.seeds
    }
    variants = {OURS: Variant(parameters={}, first=description.stages[0])} | description.variants
    made = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for linked in ("stages", "dvc.yaml", "dvc.lock", "reports/quoted"):
            (folder / linked).parent.mkdir(parents=True, exist_ok=True)
            (folder / linked).symlink_to(root / linked)
        for variant, its in variants.items():
            text = yaml.safe_dump(changed(values, own | its.parameters), sort_keys=False)
            (folder / "params.yaml").write_text(text, encoding="utf-8")
            for stage in description.stages[description.stages.index(its.first) :]:
                run_stage(f"stages/{testbed}/{stage}.py", folder, root, cell)
            results = read_results(testbed, folder / FOLDER).assign(variant=variant, cell=cell)
            made.append(results[[*KEYS, *results.columns.drop(KEYS)]])
    return pd.concat(made, ignore_index=True)


def run_stage(script: str, folder: Path, root: Path, cell: str) -> None:
    """Run a stage's script in the folder of a cell. Raises InputError if it fails."""
    path = os.pathsep.join(filter(None, [str(root / "src"), os.environ.get("PYTHONPATH")]))
    environment = {name: value for name, value in os.environ.items() if name != "DVC_STAGE"}
    options: dict[str, Any] = {"cwd": folder, "env": environment | {"PYTHONPATH": path}, "text": True}
    done = subprocess.run([sys.executable, script], capture_output=True, check=False, **options)
    if done.returncode:
        raise InputError(f"cell {cell}: {script}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")


def make_cell(name: str, description: Description, cell: str, root: Path) -> tuple[pd.DataFrame, Origin]:
    """Run a cell; return its results and by what they were made.

    Raises InputError: a stage failed, or the sources are not as committed.
    """
    commit, start = source_commit(root=root), time.monotonic()
    if commit.endswith("+changes"):
        raise InputError(
            f"{name}, cell {cell}: the sources differ from commit {commit[:8]}: commit them first"
        )
    results = run_cell(name, description, cell, root)
    minutes = round((time.monotonic() - start) / 60.0, 1)
    code = code_of(name, description, root)
    return results, Origin(commit=commit, code=code, processor=processor(), minutes=minutes)


def code_of(name: str, description: Description, root: Path) -> str:
    """Digest of all code that a study's cells use: the packages that its pipeline names, and its stages."""
    planned = read_values(root / DESCRIPTIONS.parent / "dvc.yaml")["stages"][name.replace("/", "_")]
    every = dict(code_digests((LIBRARY, REPRODUCTION)))
    digest = hashlib.sha256()
    for params in planned["do"].get("params", []):
        for key in params.get(CODE.name, []):
            digest.update(f"{key} {every[key]}\n".encode())
    for stage in description.stages:
        digest.update((root / f"stages/{name.partition('/')[0]}/{stage}.py").read_bytes())
    return digest.hexdigest()[:16]


def write_cell(results: pd.DataFrame, origin: Origin, folder: Path) -> None:
    """Publish a cell's results, with what they were made by."""
    publish_results(results, origin, folder / "cell.json")


Work = tuple[str, str]  # a study and one of its cells


def run_cells(descriptions: Mapping[str, Description], names: Sequence[str], root: Path) -> None:
    """Run all cells of these studies that are not up to date, as many at once as there are processes.

    Each is written, and entered in DVC's lock, when it is done, so a later call goes on from there. Raises
    InputError: a cell fails, after the others have run, or a worker of the cluster has other code.
    """
    write_code(root / DESCRIPTIONS.parent, (LIBRARY, REPRODUCTION))
    work = outdated_cells(names, root)
    print(plan(work, root))
    code = {name: code_of(name, descriptions[name], root) for name in names}
    failed, beside = [], min(at_once(), len(work))

    def finished(item: Work, made: tuple[pd.DataFrame, Origin] | str) -> None:
        name, cell = item
        if isinstance(made, str):
            failed.append(made)
        elif made[1].code != code[name]:
            failed.append(f"{name}, cell {cell}: made by a worker with other code, of {made[1].commit}")
        else:
            results, origin = made
            origin = origin.model_copy(update={"at_once": beside})
            write_cell(results, origin, root / CELLS / name / cell)
            dvc(root, "commit", "--quiet", "--force", stage_of(name, cell))
            print(f"{name}, cell {cell}: {origin.minutes:.1f} minutes", flush=True)

    make = partial(_made, descriptions=descriptions)
    parallel_map(make, work, "cells", lost=_lost, finished=finished)
    if failed:
        raise InputError("; ".join(failed))


def _made(item: Work, descriptions: Mapping[str, Description]) -> tuple[pd.DataFrame, Origin] | str:
    """A cell in a process that was started in the project's folder, or why it failed."""
    name, cell = item
    os.environ[BACKEND] = "sequential"  # of the cell's stages, which run in processes of their own
    try:
        return make_cell(name, descriptions[name], cell, Path.cwd())
    except InputError as error:
        return str(error)


def _lost(item: Work) -> str:
    return f"{item[0]}, cell {item[1]}: its process died twice"


def outdated_cells(names: Sequence[str], root: Path) -> list[Work]:
    """Cells of these studies that DVC would run, in order of their studies."""
    outdated = json.loads(dvc(root, "status", "--json"))
    each = [(name, cell) for name in names for cell in planned_cells(name, root)]
    return [(name, cell) for name, cell in each if stage_of(name, cell) in outdated]


def planned_cells(name: str, root: Path = Path()) -> list[str]:
    """All cells of a study, in the order of its pipeline."""
    stages = read_values(root / DESCRIPTIONS.parent / "dvc.yaml")["stages"]
    return [str(cell) for cell in stages[name.replace("/", "_")]["foreach"]]


def stage_of(name: str, cell: str) -> str:
    """Name of a cell's DVC stage."""
    return f"{name.replace('/', '_')}@{cell}"


def plan(work: Sequence[Work], root: Path) -> str:
    """What will be run and how long it takes, from the minutes of the cells in git."""
    processes = at_once()
    lines, hours = [], 0.0
    for name in dict.fromkeys(name for name, _ in work):
        count, study = sum(its == name for its, _ in work), read_study(name, root / RESULTS)
        each = study.made.minutes_each if study else float("nan")
        hours += count * each / 60.0 / processes
        told = "never timed before" if math.isnan(each) else f"about {each:.0f} minutes each"
        lines.append(f"{name}: {counted(count, 'cell')}, {told}")
    total = "" if math.isnan(hours) else f", about {hours:.1f} h"
    return "\n".join([*lines, f"{counted(len(work), 'cell')} to run, {processes} at once{total}"])


def dvc(root: Path, *arguments: str) -> str:
    """Output of a DVC command on the studies. Raises InputError: it failed."""
    command = [sys.executable, "-m", "dvc", *arguments]
    done = subprocess.run(
        command, cwd=root / DESCRIPTIONS.parent, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise InputError(f"dvc {' '.join(arguments)}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")
    return done.stdout


def publish_results(results: pd.DataFrame, made: Parameters, path: Path) -> None:
    """Publish results together with a file on their provenance, in that file's folder."""
    with publish(path.parent) as folder:
        folder.mkdir()
        write_table(results, folder / TABLE)
        (folder / path.name).write_text(made.model_dump_json(indent=2) + "\n", encoding="utf-8")


def processor() -> str:
    """Processor type, on which compiled code and library kernels depend."""
    from llvmlite import binding

    return os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
