"""Publishing a testbed's report: pages with their figures and tables, findings and metrics."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from structlearn.core.artefacts import publish, write_csv, write_metrics
from structlearn.core.parallel import parallel_map
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
    metrics: Mapping[str, int] | None = None,
) -> None:
    """Publish `NAME.html`, `figures/`, `tables/`, `findings.csv` and `metrics.json`.

    A sequence of drawings is a figure with several panels. `find`: every number that the pages state;
    headlines go to `metrics.json`, followed by further `metrics`.

    Raises ValueError: there are more than `HEADLINES` headlines.
    """
    findings = find.table()
    if (marked := int((findings["headline"] & findings["value"].notna()).sum())) > HEADLINES:
        raise ValueError(f"{marked} headlines are more than {HEADLINES}")
    folder = Path(folder)
    with publish(folder / "figures") as target:
        target.mkdir()
        figures = _figures(drawings, target)
    with publish(folder / "tables") as target:
        target.mkdir()
        for name, table in tables.items():
            write_csv(table.frame, target / f"{name}.csv")
    write_csv(findings, folder / "findings.csv")
    headlines_found = values_by_key(findings[findings["headline"]])
    write_metrics({**headlines_found, **(metrics or {})}, folder / "metrics.json")
    for name, page in pages.items():
        with publish(folder / f"{name}.html") as target:
            target.write_text(render(page, figures), encoding="utf-8")


def _figures(drawings: Mapping[str, Drawing | Sequence[Drawing]], folder: Path) -> dict[str, list[Panel]]:
    """Save all drawings in parallel, since drawing takes most of a report's time."""
    files: dict[str, list[tuple[str, Drawing]]] = {
        name: [(name, drawing)]
        if isinstance(drawing, Drawing)
        else [(f"{name}-{number}", part) for number, part in enumerate(drawing, 1)]
        for name, drawing in drawings.items()
    }
    parts = [part for figure in files.values() for part in figure]
    panels = iter(parallel_map(partial(_saved, folder=folder), parts, "figures", local=True))
    return {name: [next(panels) for _ in figure] for name, figure in files.items()}


def _saved(part: tuple[str, Drawing], folder: Path) -> Panel:
    name, drawing = part
    path, (width, height) = save(drawing, folder / name)
    return Panel(f"figures/{path.name}", width, height, drawn=not isinstance(drawing, np.ndarray))
