"""Studies: cells that run a testbed for other people or robots, and results in git that join the cells.

`stages/studies/studies.yaml` describes each study, `stages/studies/dvc.yaml` lists its cells. A cell is named
by its seeds, `13` or the range `19-26`, and writes the results of all variants of the study to
`data/studies/<study>/<cell>`. `python -m dissertation.evidence.study_tables` joins the cells that were run
into `reports/studies/<study>`; with `--check [NAME ...]` it runs one cell of each study again and compares it
with the study. No DVC stage does this: pages read these results, so `dvc repro` of a page would first run
hours of studies.
"""

import argparse
import copy
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from pydantic import Field

from dissertation.evidence.judged_page import TEMPLATES, JudgedDocument
from dissertation.evidence.results import FOLDER, read_results
from dissertation.evidence.studies import (
    KEYS,
    OURS,
    RESULTS,
    TABLE,
    Check,
    Origin,
    Study,
    StudyProvenance,
    digests,
    provenance,
    stored,
    stored_study,
)
from structlearn.core.artefacts import publish, write_table
from structlearn.core.code_digests import LIBRARY, write_code
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, checked, read_values, value_at
from structlearn.core.stage import run
from structlearn.reporting.document import render, source_commit

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
    stages: list[str] = Field(min_length=1)  # scripts of the testbed, in order; the last is `results`
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


def write_cell(results: pd.DataFrame, folder: Path, root: Path) -> None:
    """Publish a cell's results, with the commit of the code that made them."""
    origin = Origin(commit=source_commit(root=root), processor=processor())
    publish_results(results, origin, folder / "cell.json")


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


def main() -> None:
    """Join or check studies, and write the page of all studies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="e.g. scraping/people; default all")
    parser.add_argument("--check", action="store_true", help="run one cell of each again")
    parser.add_argument("--code", action="store_true", help="write the digests of the code that cells use")
    given, root, descriptions = parser.parse_args(), Path.cwd(), read_descriptions()
    if unknown := sorted(set(given.names) - set(descriptions)):
        raise InputError(f"no study {', '.join(unknown)}; there are {', '.join(descriptions)}")
    if given.code:
        write_code(DESCRIPTIONS.parent, (LIBRARY, REPRODUCTION))
        return
    different = []
    for name in given.names or descriptions:
        if given.check:
            different += check_study(name, descriptions[name], root)
        else:
            join_study(name, descriptions[name], root)
    with publish(RESULTS / "index.html") as path:
        path.write_text(studies_page(descriptions), encoding="utf-8")
    print(f"{RESULTS}/index.html is up to date")
    if different:
        raise InputError(f"the present code gives other numbers: {', '.join(different)}")


def join_study(name: str, description: Description, root: Path) -> None:
    """Join the cells of a study that were run into its tables in git."""
    found = sorted((root / CELLS / name).glob("*/cell.json"))
    cells = {path.parent.name: stored(path, Origin) for path in found}
    if cells:
        path = root / RESULTS / name / "study.json"
        before = stored_study(path.parent) if path.exists() else None
        study = joined(before, cells, made_with(name, description, root), description)
        publish_results(study.results, study.made, path)
    print(f"{name}: {len(cells)} cells joined")


def check_study(name: str, description: Description, root: Path) -> list[str]:
    """Run the newest cell of a study again and record the result; return differences as `study: quantity`."""
    folder = root / RESULTS / name
    if not (folder / "study.json").exists():
        return []
    study = stored_study(folder)
    if study.made.parameters != made_with(name, description, root):
        raise InputError(f"{folder}: made with other parameters than these: make studies NAME={name}")
    cell = list(study.made.cells)[-1]
    check = compare(run_cell(name, description, cell, root), study, cell, root)
    publish_results(study.results, study.made.model_copy(update={"check": check}), folder / "study.json")
    print(f"{name}, cell {cell}: {check.compared} numbers compared, {len(check.different)} quantities differ")
    return [f"{name}: {quantity}" for quantity in check.different]


def studies_page(descriptions: Mapping[str, Description]) -> str:
    """Page of all studies that were run, as HTML."""
    names = [name for name in sorted(descriptions) if (RESULTS / name / "study.json").exists()]
    found = {name: stored_study(RESULTS / name) for name in names}
    told = {name: provenance(study) for name, study in found.items()}
    moved = {name: moved_parameters(name, descriptions[name], study) for name, study in found.items()}
    facts = {"descriptions": descriptions, "studies": found, "provenance": told, "moved": moved}
    document = JudgedDocument("studies.html.jinja", TEMPLATES, facts=facts, simulated=True)
    return render(document, figures={})


def moved_parameters(name: str, description: Description, study: Study, root: Path = Path()) -> list[str]:
    """Keys of `params.yaml` whose values are not those that a study was made with."""
    now, then = made_with(name, description, root), study.made.parameters
    return sorted(key for key in now.keys() | then.keys() if now.get(key) != then.get(key))


def joined(
    before: Study | None,
    cells: Mapping[str, tuple[pd.DataFrame, Origin]],
    made_with: Mapping[str, str],
    description: Description,
) -> Study:
    """Add or replace cells of a study.

    `before`: the study in git, dropped if its parameters are not the cells' (`made_with`).
    """
    parts, origins, check = [results for results, _ in cells.values()], {}, None
    if before and before.made.parameters == made_with:
        parts.insert(0, before.results.query("cell not in @cells"))
        origins, check = before.made.cells, before.made.check
    origins = origins | {cell: origin for cell, (_, origin) in cells.items()}
    order = sorted(origins, key=lambda cell: seeds_of(cell)[0])
    whole, variants = pd.concat(parts, ignore_index=True), [OURS, *description.variants]
    places = whole["variant"].map(variants.index) * len(order) + whole["cell"].map(order.index)
    made = StudyProvenance(
        parameters=dict(made_with),
        seeds=description.seeds,
        cells={cell: origins[cell] for cell in order},
        check=check if check and check.cell not in cells else None,
    )
    return Study(whole.iloc[np.argsort(places.to_numpy(), kind="stable")].reset_index(drop=True), made)


def made_with(name: str, description: Description, root: Path) -> dict[str, str]:
    """Digests of the parameters that a study's stages depend on."""
    testbed, stages = name.partition("/")[0], read_values(root / "dvc.yaml")["stages"]
    its = [stages[f"{testbed}_{stage}"] for stage in description.stages]
    keys = sorted({key.split(".")[0] for one in its for key in one.get("params", [])})
    return digests(read_values(root / "params.yaml"), keys, description.seeds)


def compare(found: pd.DataFrame, study: Study, cell: str, root: Path) -> Check:
    """Compare the results of a cell that was run again with those of the study."""
    results = study.results
    keys = [name for name in results if name not in ("cell", "stage", "unit", "value")]
    known = results[results["cell"] == cell].set_index(keys)["value"]
    new = found.set_index(keys)["value"].reindex(known.index)
    off = (known - new).abs().mask(known.isna() & new.isna(), 0.0).fillna(np.inf)
    largest = off.groupby("quantity").max()
    different = largest[largest > 0.0].index.tolist()
    return Check(cell=cell, commit=source_commit(root=root), compared=len(known), different=different)


if __name__ == "__main__":
    run(main, stage=False)
