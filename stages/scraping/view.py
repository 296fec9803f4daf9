"""Rerun views: demonstrations, alignment, primitives (IV.5), executions and refinement (IV.9)."""

from dissertation.scraping.files import ScrapingFiles
from dissertation.scraping.recordings.executions_recording import (
    read_feedback_runs,
    read_refined_runs,
    write_executions,
    write_robot,
)
from dissertation.scraping.recordings.nominal_recordings import (
    write_alignment,
    write_demonstrations,
    write_primitives,
)
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import read_segmentation


def main() -> None:
    parameters = stage_parameters("segment", SegmentParameters)
    files = ScrapingFiles()
    demonstrations, segmentation = files.runs("nominal"), read_segmentation("data/segments/scraping")
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    paths = {name: files.table(name) for name in ("nominal", "generalised")}
    with_feedback, refined = read_feedback_runs(files), read_refined_runs(files)

    with publish("reports/rerun/scraping") as folder:
        folder.mkdir()
        write_demonstrations(
            folder / "demonstrations.rrd", demonstrations, segmentation, "Scraping: demonstrations"
        )
        write_alignment(
            folder / "alignment.rrd", demonstrations, segmentation, parameters, "Scraping: alignment"
        )
        write_primitives(folder / "primitives.rrd", demonstrations, primitives, paths, "Scraping: primitives")
        if with_feedback:
            *_, shown = with_feedback[max(with_feedback)]
            write_executions(folder / "feedback.rrd", with_feedback, "Scraping: feedback")
            write_robot(folder / "robot.rrd", shown, "Scraping: robot with feedback")
        if refined:
            search = (files.table("history"), files.table("rollouts"))
            write_executions(folder / "refinement.rrd", refined, "Scraping: refinement", search)


if __name__ == "__main__":
    run(main)
