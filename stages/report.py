"""The front page: one card per testbed, from the numbers that their reports wrote."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run
from structlearn.reporting.claims import QUOTED
from structlearn.reporting.front import read_report, render_front

TESTBEDS = ("scraping", "obstacles", "dynamics", "servoing", "recorded")
"""In the order of the page."""

PAGES = {
    "scraping": {"feedback.html": "Feedback", "refinement.html": "Refinement by trial"},
    "recorded": {
        "boxes.html": "People past boxes",
        "skin.html": "Magnetic skin",
        "ur10e.html": "UR10e and its load",
    },
}
CARDS = Path(__file__).parents[1] / "src/structlearn/testbeds"


def main() -> None:
    reports = [
        read_report(
            QUOTED if testbed == "recorded" else Path("reports", testbed),
            CARDS / testbed / "page/card.yaml",
            PAGES.get(testbed),
        )
        for testbed in TESTBEDS
    ]
    with publish("reports/index.html") as path:
        path.write_text(render_front(reports), encoding="utf-8")


if __name__ == "__main__":
    run(main)
