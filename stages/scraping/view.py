"""Recordings to look at: demonstrations, alignment, primitives (IV.5), executions and refinement (IV.9)."""

from pathlib import Path

from structlearn.ground.artefacts import publish, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.recordings import read_demonstrations
from structlearn.recordings.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.result import read_segmentation
from structlearn.testbeds.scraping.recordings.alignment_recording import write_alignment
from structlearn.testbeds.scraping.recordings.executions_recording import write_executions
from structlearn.testbeds.scraping.recordings.refinement_recording import write_refinement
from structlearn.testbeds.scraping.recordings.robot_recording import write_robot
from structlearn.testbeds.scraping.recordings.shown_runs import read_refined_runs, read_shown_runs
from structlearn.viewer.learned_primitives import write_primitives
from structlearn.viewer.recorded_demonstrations import write_demonstrations

RAW, FEEDBACK = Path("data/raw/scraping"), Path("data/feedback/scraping")
SHOWN_MODEL = "pointwise"  # trained as in the dissertation


def main() -> None:
    parameters = stage_parameters("segment", SegmentParameters)
    clock = stage_parameters("clock", ClockParameters)
    demonstrations = read_demonstrations(RAW / "nominal", **clock.model_dump())
    segmentation = read_segmentation("data/segments/scraping")
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    paths = {
        name: read_table(f"data/primitives/scraping/{name}.parquet") for name in ("nominal", "generalised")
    }
    names = [primitive.name for primitive in primitives]
    runs = read_shown_runs(RAW, FEEDBACK, SHOWN_MODEL, names, clock)
    refined = read_refined_runs(RAW, FEEDBACK, names, clock)

    with publish("reports/recordings/scraping") as folder:
        folder.mkdir()
        write_demonstrations(
            folder / "demonstrations.rrd", demonstrations, segmentation, "Scraping: demonstrations"
        )
        write_alignment(
            folder / "alignment.rrd", demonstrations, segmentation, parameters, "Scraping: alignment"
        )
        write_primitives(folder / "primitives.rrd", demonstrations, primitives, paths, "Scraping: primitives")
        if runs:
            *_, with_feedback = runs[max(runs)]
            write_executions(folder / "feedback.rrd", runs, "Scraping: feedback")
            write_robot(folder / "robot.rrd", with_feedback, "Scraping: robot with feedback")
        if refined:
            search = [read_table(FEEDBACK / f"refinement/{name}.parquet") for name in ("history", "rollouts")]
            write_refinement(folder / "refinement.rrd", refined, *search, "Scraping: refinement")


if __name__ == "__main__":
    run(main)
