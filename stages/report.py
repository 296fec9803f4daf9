"""The overview of all testbeds: one card each, from the metrics that their reports wrote."""

from pathlib import Path

from structlearn.ground.artefacts import publish, read_metrics
from structlearn.ground.stage import run
from structlearn.reporting.overview import DYNAMICS, OBSTACLES, SCRAPING, SERVOING, overview_page
from structlearn.reporting.page import render

CARDS = (SCRAPING, OBSTACLES, DYNAMICS, SERVOING)


def main() -> None:
    files = {card: Path(f"reports/{card.folder}/metrics.json") for card in CARDS}
    # of testbeds run one by one, some have no report yet
    cards = [(card, read_metrics(file)) for card, file in files.items() if file.exists()]
    with publish("reports/index.html") as path:
        path.write_text(render(overview_page(cards)), encoding="utf-8")


if __name__ == "__main__":
    run(main)
