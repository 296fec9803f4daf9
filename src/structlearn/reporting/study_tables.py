"""Tables of studies in git: `python -m structlearn.reporting.study_tables` joins the cells that were run.

With `--check [NAME ...]` it runs one cell of each study again and compares it with the table. No stage of
DVC does this: pages read these tables, so `dvc repro` of a page would run hours of studies first.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.artefacts import publish, write_csv
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.core.stage import run
from structlearn.reporting import studies, study_cells
from structlearn.reporting.document import Document, render, source_commit
from structlearn.reporting.studies import OURS, RESULTS, Check, Made, Origin, Study, provenance, stored_study
from structlearn.reporting.study_cells import Description

TOLERANCE = 1e-3  # relative, on another type of processor than the table's, whose kernels round otherwise


def main() -> None:
    """Join or check, and write the page of all studies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="e.g. scraping/people; default all")
    parser.add_argument("--check", action="store_true", help="run one cell of each again")
    given, root, descriptions = parser.parse_args(), Path.cwd(), study_cells.read_descriptions()
    if unknown := sorted(set(given.names) - set(descriptions)):
        raise InputError(f"no study {', '.join(unknown)}; there are {', '.join(descriptions)}")
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
    """Put the cells of a study that were run into its tables in git."""
    folders = sorted(path.parent for path in (root / study_cells.CELLS / name).glob("*/cell.json"))
    cells = {folder.name: study_cells.read_cell(folder) for folder in folders}
    if cells:
        folder = root / RESULTS / name
        before = stored_study(folder) if (folder / "study.json").exists() else None
        write_study(joined(before, cells, made_with(name, description, root), description), folder)
    print(f"{name}: {len(cells)} cells joined")


def check_study(name: str, description: Description, root: Path) -> list[str]:
    """Run the newest cell of a study again and write the result; returns what differs, `study: column`."""
    folder = root / RESULTS / name
    if not (folder / "study.json").exists():
        return []
    study = stored_study(folder)
    assert study.made is not None
    if study.made.parameters != made_with(name, description, root):
        raise InputError(f"{folder}: made with other parameters than these: make studies NAME={name}")
    cell = list(study.made.cells)[-1]
    check = compare(study_cells.run_cell(name, description, cell, root), study, cell, root)
    write_study(Study(study.tables, study.made.model_copy(update={"check": check})), folder)
    print(f"{name}, cell {cell}: {check.compared} numbers compared, {len(check.different)} columns differ")
    return [f"{name}: {column}" for column in check.different]


def studies_page(descriptions: Mapping[str, Description]) -> str:
    """The page of all studies as HTML: those that can be run, and others whose tables pages quote."""
    names = sorted(path.parent.relative_to(RESULTS).as_posix() for path in RESULTS.glob("*/*/study.json"))
    found = {name: stored_study(RESULTS / name) for name in names}
    told = {name: provenance(study) for name, study in found.items()}
    facts = {"descriptions": descriptions, "studies": found, "provenance": told}
    document = Document("studies.html.jinja", "structlearn.reporting", facts=facts, simulated=True)
    return render(document, figures={})


def joined(
    before: Study | None,
    cells: Mapping[str, tuple[Mapping[str, pd.DataFrame], Origin]],
    made_with: Mapping[str, str],
    description: Description,
) -> Study:
    """A study with more cells, or some of them made anew; tables keep the columns that all cells have.

    `before`: as it is in git, dropped if its parameters are not those of the cells, `made_with`.
    """
    known = before.made if before else None
    if before is None or known is None or known.parameters != made_with:
        before = known = None
    origins = (known.cells if known else {}) | {cell: origin for cell, (_, origin) in cells.items()}
    order = sorted(origins, key=lambda cell: study_cells.seeds_of(cell)[0])
    variants = [OURS, *description.variants]
    tables = {}
    for name in (Path(table).name for table in description.tables):
        parts = [its[name] for its, _ in cells.values()]
        if before and name in before.tables:
            parts.insert(0, before.tables[name].query("cell not in @cells"))
        whole = pd.concat(parts, join="inner", ignore_index=True)
        places = whole["variant"].map(variants.index) * len(order) + whole["cell"].map(order.index)
        tables[name] = whole.iloc[np.argsort(places.to_numpy(), kind="stable")].reset_index(drop=True)
    check = known.check if known else None
    made = Made(
        parameters=dict(made_with),
        seeds=description.seeds,
        cells={cell: origins[cell] for cell in order},
        check=check if check and check.cell not in cells else None,
    )
    return Study(tables, made)


def write_study(study: Study, folder: Path) -> None:
    """Write the tables of a study, and how it was made."""
    for name, table in study.tables.items():
        write_csv(table, folder / f"{name}.csv")
    assert study.made is not None
    with publish(folder / "study.json") as path:
        path.write_text(study.made.model_dump_json(indent=2) + "\n", encoding="utf-8")


def made_with(name: str, description: Description, root: Path) -> dict[str, str]:
    """Digests of the parameters that the stages of a study depend on."""
    testbed, stages = name.partition("/")[0], read_values(root / "dvc.yaml")["stages"]
    its = [stages[f"{testbed}_{stage}"] for stage in description.stages]
    own = [key for one in its for key in one.get("params", [])]
    files = [Path(dep) for one in its for dep in one.get("deps", [])]
    shared = [path.stem for path in files if path.match("data/code/main/*.yaml")]  # keys that stages share
    keys = sorted({key.split(".")[0] for key in (*own, *shared)})
    return studies.digests(read_values(root / "params.yaml"), keys, description.seeds)


def compare(found: Mapping[str, pd.DataFrame], study: Study, cell: str, root: Path) -> Check:
    """Compare the tables of one cell, run again, with those of the study."""
    assert study.made is not None
    here, check = study_cells.processor(), study.made.check
    known_on = {study.made.cells[cell].processor} | ({check.processor} if check and check.exact else set())
    exact = here in known_on
    compared, different = 0, []
    for name, table in study.tables.items():
        known = table[table["cell"] == cell].reset_index(drop=True)
        new = found[name].reset_index(drop=True)
        for column in table.columns.drop(studies.KEYS):
            compared += len(known)
            alike = column in new and len(new) == len(known) and _alike(known[column], new[column], exact)
            different += [] if alike else [f"{name}.{column}"]
    made = {"cell": cell, "commit": source_commit(root=root), "processor": here}
    return Check(**made, exact=exact, compared=compared, different=different)


def _alike(known: pd.Series, new: pd.Series, exact: bool) -> bool:
    """Whether two columns are equal; numbers were written with six digits."""
    if not (pd.api.types.is_numeric_dtype(known) and pd.api.types.is_numeric_dtype(new)):
        return bool((known.fillna("").astype(str) == new.fillna("").astype(str)).all())
    first, second = known.to_numpy(float), new.to_numpy(float)
    tolerance = 0.0 if exact else TOLERANCE
    return bool(np.isclose(first, second, rtol=tolerance, atol=0.0, equal_nan=True).all())


if __name__ == "__main__":
    run(main)
