"""A testbed's report on disk: pages, the figures and tables that they show, metrics and details."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from structlearn.ground.artefacts import Metrics, publish, write_csv, write_metrics
from structlearn.reporting.claims import Judged, claim_metrics, claims_table
from structlearn.reporting.document import Document, Panel, Table, render
from structlearn.reporting.figure_style import Drawing, save

HEADLINES = 12
"""Most numbers of a `metrics.json` beside the counts of verdicts: `dvc metrics show` stays readable."""


def publish_report(
    folder: str | Path,
    pages: Mapping[str, Document],
    drawings: Mapping[str, Drawing | Sequence[Drawing]],
    tables: Mapping[str, Table],
    metrics: Metrics,
    headlines: Sequence[str],
) -> None:
    """Publish `NAME.html`, `figures/`, `tables/`, `metrics.json` and `details.json`.

    Args:
        folder: of the testbed's report.
        pages: by name, e.g. `index`.
        drawings: by name; a sequence is a figure of several panels.
        tables: by name, whether a page shows them or not; `claims` is added.
        metrics: flat.
        headlines: those that stand in `metrics.json`, with the counts of verdicts; the others are details.

    Raises:
        ValueError: a headline is not among the metrics, or there are too many of them.
    """
    if missing := set(headlines) - set(metrics):
        raise ValueError(f"headlines {sorted(missing)} are no metrics")
    if len(headlines) > HEADLINES:
        raise ValueError(f"{len(headlines)} headlines are more than {HEADLINES}")
    folder = Path(folder)
    judged: list[Judged] = [one for page in pages.values() for one in page.judged]
    with publish(folder / "figures") as target:
        target.mkdir()
        figures = {name: _panels(name, drawing, target) for name, drawing in drawings.items()}
    with publish(folder / "tables") as target:
        target.mkdir()
        for name, table in tables.items():
            write_csv(table.frame, target / f"{name}.csv")
        if judged:
            write_csv(claims_table(judged), target / "claims.csv")
    write_metrics(
        {name: metrics[name] for name in headlines} | claim_metrics(judged), folder / "metrics.json"
    )
    details = {name: value for name, value in metrics.items() if name not in headlines}
    write_metrics(details, folder / "details.json")
    for name, page in pages.items():
        with publish(folder / f"{name}.html") as target:
            target.write_text(render(page, figures), encoding="utf-8")


def _panels(name: str, drawing: Drawing | Sequence[Drawing], folder: Path) -> list[Panel]:
    several = isinstance(drawing, Sequence) and not isinstance(drawing, np.ndarray)
    parts = {f"{name}-{number}": one for number, one in enumerate(drawing, 1)} if several else {name: drawing}
    panels = []
    for part, one in parts.items():
        path, (width, height) = save(one, folder / part)
        panels.append(Panel(f"figures/{path.name}", width, height))
    return panels
