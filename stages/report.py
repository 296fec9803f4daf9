"""The overview of all testbeds: one card each, from the metrics that their reports wrote."""

from structlearn.artefacts import publish, read_metrics
from structlearn.reporting.overview import SCRAPING, overview_page
from structlearn.reporting.page import render
from structlearn.stage import run


def main() -> None:
    cards = [(card, read_metrics(f"reports/{card.folder}/metrics.json")) for card in (SCRAPING,)]
    with publish("reports/index.html") as path:
        path.write_text(render(overview_page(cards)), encoding="utf-8")


if __name__ == "__main__":
    run(main)
