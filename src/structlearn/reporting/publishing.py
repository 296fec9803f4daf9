"""A testbed's report on disk: figures, tables, metrics and the page that shows them."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from structlearn.ground.artefacts import Metrics, publish, write_csv, write_metrics
from structlearn.reporting.figures import save
from structlearn.reporting.page import Page, Sizes, render


def publish_report(
    folder: str | Path,
    pictures: Mapping[str, Figure],
    tables: Mapping[str, pd.DataFrame],
    metrics: Metrics,
    page: Callable[[Sizes], Page],
) -> None:
    """Publish `figures/NAME.png`, `tables/NAME.csv`, `metrics.json` and `index.html`.

    Args:
        folder: of the testbed's report.
        pictures: figures by name.
        tables: by name.
        metrics: flat.
        page: makes the page, given the sizes of the figures.
    """
    folder = Path(folder)
    with publish(folder / "figures") as target:
        target.mkdir()
        sizes = {name: save(figure, target / f"{name}.png") for name, figure in pictures.items()}
    with publish(folder / "tables") as target:
        target.mkdir()
        for name, table in tables.items():
            write_csv(table, target / f"{name}.csv")
    write_metrics(metrics, folder / "metrics.json")
    with publish(folder / "index.html") as target:
        target.write_text(render(page(sizes)), encoding="utf-8")
