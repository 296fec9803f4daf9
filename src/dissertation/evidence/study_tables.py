"""Studies in git that join their cells, and the page that lists them.

`python -m dissertation.evidence.study_tables [NAME ...]` runs the cells that are not up to date
(`study_cells`) and joins them into `reports/studies/<study>`; with `--check` it runs one cell of each study
again and compares it with the study. No DVC stage does this: pages read these results, so `dvc repro` of a
page would first run hours of studies.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.evidence.judged_page import TEMPLATES, JudgedDocument
from dissertation.evidence.studies import (
    OURS,
    RESULTS,
    Check,
    Origin,
    Study,
    StudyProvenance,
    digests,
    provenance,
    stored,
    stored_study,
)
from dissertation.evidence.study_cells import (
    CELLS,
    DESCRIPTIONS,
    REPRODUCTION,
    Description,
    dvc,
    planned_cells,
    publish_results,
    read_descriptions,
    run_cell,
    run_cells,
    seeds_of,
    stage_of,
)
from structlearn.core.artefacts import publish
from structlearn.core.code_digests import LIBRARY, write_code
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.core.stage import run
from structlearn.reporting.document import render, source_commit
from structlearn.reporting.prose import counted, listing


def main() -> None:
    """Join or check studies, and write the page of all studies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="e.g. scraping/people; default all")
    parser.add_argument("--check", action="store_true", help="run one cell of each again")
    given, root, descriptions = parser.parse_args(), Path.cwd(), read_descriptions()
    if unknown := sorted(set(given.names) - set(descriptions)):
        raise InputError(f"no study {', '.join(unknown)}; there are {', '.join(descriptions)}")
    names, different = given.names or list(descriptions), []
    if given.check:
        for name in names:
            different += check_study(name, descriptions[name], root)
    else:
        try:
            run_cells(descriptions, names, root)
        finally:  # a study cut short has the cells that were made
            for name in names:
                join_study(name, descriptions[name], root)
    with publish(RESULTS / "index.html") as path:
        path.write_text(studies_page(descriptions), encoding="utf-8")
    print(f"{RESULTS}/index.html is up to date")
    if different:
        raise InputError(f"the present code gives other numbers: {', '.join(different)}")
    if given.check:  # DVC need not run the cells again
        write_code(root / DESCRIPTIONS.parent, (LIBRARY, REPRODUCTION))
        for name in names:
            for path in sorted((root / CELLS / name).glob("*/cell.json")):
                dvc(root, "commit", "--quiet", "--force", stage_of(name, path.parent.name))


def join_study(name: str, description: Description, root: Path) -> None:
    """Join the cells of a study that were run into its tables in git."""
    found = sorted((root / CELLS / name).glob("*/cell.json"))
    cells = {path.parent.name: stored(path, Origin) for path in found}
    if cells:
        path = root / RESULTS / name / "study.json"
        before = stored_study(path.parent) if path.exists() else None
        study = joined(before, cells, made_with(name, description, root), description)
        publish_results(study.results, study.made, path)
        if before and (dropped := sorted(set(before.made.cells) - set(study.made.cells))):
            print(f"{name}: {listing(dropped)} of other code or parameters dropped; git has them")
    print(f"{name}: {counted(len(cells), 'cell')} joined")


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
    cells = {name: planned_cells(name) for name in names}
    facts = {
        "descriptions": descriptions,
        "studies": found,
        "provenance": told,
        "moved": moved,
        "planned": {name: len(its) for name, its in cells.items()},
        "individuals": {
            name: sum(len(seeds_of(cell)) for cell in study.made.cells) for name, study in found.items()
        },
    }
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

    `before`: the study in git, dropped if its parameters (`made_with`) or its code are not the cells'.
    Raises InputError: cells were made by different code.
    """
    by_code: dict[str, list[str]] = {}
    for cell, (_, origin) in cells.items():
        by_code.setdefault(origin.code, []).append(f"{cell} by {origin.commit}")
    if len(by_code) > 1:
        told = "; ".join(listing(its) for its in by_code.values())
        raise InputError(f"cells of one study were made by different code: {told}; run the older ones again")
    parts, origins, check = [results for results, _ in cells.values()], {}, None
    if before and before.made.parameters == made_with and before.made.code == set(by_code):
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
    if description.parameters:
        return digests(read_values(root / "params.yaml"), description.parameters, description.seeds)
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
