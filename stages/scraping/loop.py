"""Animation of the front page: one run on the tilted board without and with feedback (IV.9.3.5)."""

from dissertation.scraping.files import CLOSED_LOOP, ScrapingFiles
from dissertation.scraping.names import RUNS
from dissertation.scraping.protocol.execution_scores import NOMINAL, ExecutionParameters
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.world.scene_still import write_loop
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.palette import Look


def main() -> None:
    tilt = max(stage_parameters("evaluate_feedback", ExecutionParameters).settings_deg)
    files = ScrapingFiles()
    runs = [
        (Look(name, RUNS[model].colour), files.runs_at(tilt, CLOSED_LOOP, model)[0])
        for model, name in ((NOMINAL, "without feedback"), (POINTWISE, "with feedback"))
    ]
    with publish("reports/scraping/loop.webp") as path:
        write_loop(path, runs, tilt)


if __name__ == "__main__":
    run(main)
