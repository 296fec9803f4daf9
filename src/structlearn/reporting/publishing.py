"""A testbed's report on disk: pages with their figures and tables, findings and metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import publish, write_csv, write_metrics
from structlearn.core.parallel import parallel_map
from structlearn.reporting.claims import Judged, claim_metrics, claims_table, on_recordings
from structlearn.reporting.document import Document, Panel, Table, render
from structlearn.reporting.figure_style import Drawing, save
from structlearn.reporting.findings import Findings, values_by_key

HEADLINES = 12  # most headlines in `metrics.json`, so that `dvc metrics show` stays readable


def publish_report(
    folder: str | Path,
    pages: Mapping[str, Document],
    drawings: Mapping[str, Drawing | Sequence[Drawing]],
    tables: Mapping[str, Table],
    find: Findings,
    recorded: pd.DataFrame | None = None,
) -> None:
    """Publish `NAME.html`, `figures/`, `tables/`, `findings.csv` and `metrics.json`.

    A sequence of drawings is a figure of several panels; the table `claims` is added. `find`: every number on
    the pages; headlines go to `metrics.json`, with the counts of verdicts. `recorded`: claims about recorded
    data, for statements that were also tested on them. Raises ValueError: too many headlines.
    """
    found = find.table()
    if (marked := int((found["headline"] & found["value"].notna()).sum())) > HEADLINES:
        raise ValueError(f"{marked} headlines are more than {HEADLINES}")
    folder = Path(folder)
    shown = {id(one): one for page in pages.values() for one in page.judged}  # pages may share claims
    judged: list[Judged] = list(shown.values())
    both = [] if recorded is None else on_recordings(recorded, folder.name, claims_table(judged))
    with publish(folder / "figures") as target:
        target.mkdir()
        figures = _figures(drawings, target)
    with publish(folder / "tables") as target:
        target.mkdir()
        for name, table in tables.items():
            write_csv(table.frame, target / f"{name}.csv")
        if judged:
            write_csv(claims_table(judged), target / "claims.csv")
    write_csv(found, folder / "findings.csv")
    headlines_found = values_by_key(found[found["headline"]])
    write_metrics(headlines_found | claim_metrics(judged), folder / "metrics.json")
    for name, page in pages.items():
        its = [one for one in both if one.counterpart.page == name]
        with publish(folder / f"{name}.html") as target:
            target.write_text(render(replace(page, recorded=its), figures), encoding="utf-8")


def _figures(drawings: Mapping[str, Drawing | Sequence[Drawing]], folder: Path) -> dict[str, list[Panel]]:
    """Save all drawings in processes, since drawing takes most of a report's time."""
    files: dict[str, list[tuple[str, Drawing]]] = {
        name: [(name, drawing)]
        if isinstance(drawing, Drawing)
        else [(f"{name}-{number}", one) for number, one in enumerate(drawing, 1)]
        for name, drawing in drawings.items()
    }
    parts = [part for its in files.values() for part in its]
    panels = iter(parallel_map(partial(_saved, folder=folder), parts, "figures", local=True))
    return {name: [next(panels) for _ in its] for name, its in files.items()}


def _saved(part: tuple[str, Drawing], folder: Path) -> Panel:
    name, drawing = part
    path, (width, height) = save(drawing, folder / name)
    return Panel(f"figures/{path.name}", width, height)
