"""Cells of studies: the stages of a testbed run for other people or robots, in a temporary folder.

`stages/studies/studies.yaml` describes each study, `stages/studies/dvc.yaml` lists its cells. A cell is named
by its seeds, `13` or the range `19-26`. It leaves the tables of all variants of the study in
`data/studies/<study>/<cell>`; `study_tables` gathers them for git, in `reports/studies/<study>`.
"""

import copy
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from pydantic import Field

from structlearn.core.artefacts import publish, read_csv, read_metrics, write_csv
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, checked, read_values, value_at
from structlearn.reporting.document import source_commit
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.reporting.studies import KEYS, OURS, Origin

DESCRIPTIONS = Path("stages/studies/studies.yaml")
CELLS = Path("data/studies")
FINDINGS = "findings"  # the table that becomes one row of numbers for each variant and cell


class Variant(Parameters):
    """What a variant of a study changes beside the seeds."""

    parameters: dict[str, Any]  # by dotted key
    first: str  # stage that runs first; it finds what the variants above left of earlier stages


class Description(Parameters):
    """A study."""

    question: str
    seeds: list[str] = Field(min_length=1)  # parameters that are set to the seeds of a cell, by dotted key
    stages: list[str] = Field(min_length=1)  # scripts of the testbed, in order; the report is the last
    takes: tuple[str, ...] = ()  # outputs of the pipeline that these stages read as they are
    tables: list[str] = Field(min_length=1)  # that are kept of `reports/<testbed>`
    numbers: tuple[str, ...] = ("*",)  # of `findings`, by wildcards
    variants: dict[str, Variant] = Field(default_factory=dict)  # beside the pipeline's own parameters, `OURS`


def read_descriptions(path: Path = DESCRIPTIONS) -> dict[str, Description]:
    """All studies by name, e.g. `scraping/people`; an InputError if a key is missing, unknown or twice."""
    return {name: checked(its, Description, path, name) for name, its in read_values(path).items()}


def seeds_of(cell: str) -> list[int]:
    """Seeds of a cell: `13` is one, `19-26` are eight; an InputError for other names."""
    first, _, last = cell.partition("-")
    try:
        seeds = list(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"cell {cell}: not a seed, nor a range of seeds such as 19-26") from error
    if not seeds:
        raise InputError(f"cell {cell}: no seed; {last} is below {first}")
    return seeds


def changed(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of `params.yaml` with some set to other values, by dotted key; an InputError if absent."""
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


def run_cell(name: str, description: Description, cell: str, root: Path) -> dict[str, pd.DataFrame]:
    """Run the stages of a study's testbed for one cell; tables by name, with the columns `KEYS` first."""
    testbed, seeds, parameters = name.partition("/")[0], seeds_of(cell), root / "params.yaml"
    values = read_values(parameters)
    own = {
        key: seeds if isinstance(value_at(parameters, key), list) else seeds[0] for key in description.seeds
    }
    variants = {OURS: Variant(parameters={}, first=description.stages[0])} | description.variants
    made = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for linked in ("stages", "dvc.yaml", "dvc.lock", "reports/quoted", *description.takes):
            (folder / linked).parent.mkdir(parents=True, exist_ok=True)
            (folder / linked).symlink_to(root / linked)
        for variant, its in variants.items():
            text = yaml.safe_dump(changed(values, own | its.parameters), sort_keys=False)
            (folder / "params.yaml").write_text(text, encoding="utf-8")
            for stage in description.stages[description.stages.index(its.first) :]:
                run_stage(f"stages/{testbed}/{stage}.py", folder, root, cell)
            made.append(kept(description, folder / "reports" / testbed, variant, cell))
    return {table: pd.concat([one[table] for one in made], ignore_index=True) for table in made[0]}


def run_stage(script: str, folder: Path, root: Path, cell: str) -> None:
    """Run a script of a stage in the folder of a cell; an InputError if it fails."""
    path = os.pathsep.join(filter(None, [str(root / "src"), os.environ.get("PYTHONPATH")]))
    environment = {name: value for name, value in os.environ.items() if name != "DVC_STAGE"}
    options: dict[str, Any] = {"cwd": folder, "env": environment | {"PYTHONPATH": path}, "text": True}
    done = subprocess.run([sys.executable, script], capture_output=True, check=False, **options)
    if done.returncode:
        raise InputError(f"cell {cell}: {script}: {(done.stderr.strip() or 'failed').splitlines()[-1]}")


def kept(description: Description, reports: Path, variant: str, cell: str) -> dict[str, pd.DataFrame]:
    """The tables that a study keeps of a testbed's report, with the columns `KEYS` first."""
    found, labels = {}, dict(zip(KEYS, (variant, cell), strict=True))
    for table in description.tables:
        path = reports / f"{table}.csv"
        if table == FINDINGS:
            numbers = values_by_key(read_findings(path))
            wanted = [key for key in numbers if any(fnmatch(key, one) for one in description.numbers)]
            frame = pd.DataFrame([labels | {key: numbers[key] for key in wanted}])
        else:
            frame = read_csv(path)
            frame = frame.assign(**labels)[[*KEYS, *frame.columns]]
        found[path.stem] = frame
    return found


def write_cell(tables: Mapping[str, pd.DataFrame], folder: Path, root: Path) -> None:
    """Publish the tables of a cell, with the commit of the code that made them."""
    with publish(folder) as target:
        target.mkdir()
        for name, table in tables.items():
            write_csv(table, target / f"{name}.csv")
        origin = Origin(commit=source_commit(root=root), processor=processor())
        (target / "cell.json").write_text(origin.model_dump_json(indent=2) + "\n", encoding="utf-8")


def read_cell(folder: Path) -> tuple[dict[str, pd.DataFrame], Origin]:
    """Tables and origin of a cell; an InputError if a file is missing or damaged."""
    path = folder / "cell.json"
    tables = {table.stem: read_csv(table, dtype={KEYS[1]: str}) for table in sorted(folder.glob("*.csv"))}
    return tables, checked(read_metrics(path), Origin, path, "cell")


def processor() -> str:
    """Type of the processor, by which compiled code and the kernels of libraries differ."""
    from llvmlite import binding

    return os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
