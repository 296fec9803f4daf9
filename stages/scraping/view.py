"""Rerun views: demonstrations, alignment, primitives (IV.5), executions and refinement (IV.9)."""

from dissertation.scraping.files import ScrapingFiles
from dissertation.scraping.recordings import executions_recording as board
from dissertation.scraping.recordings import nominal_recordings as nominal
from structlearn.core.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import read_segmentation
from structlearn.viewer.recording import publish_recordings


def main() -> None:
    parameters, files = stage_parameters("segment", SegmentParameters), ScrapingFiles()
    runs, segmentation = files.runs("nominal"), read_segmentation("data/segments/scraping")
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    paths = {name: files.table(name) for name in ("nominal", "generalised")}
    recordings = {
        "demonstrations": nominal.demonstrations(runs, segmentation),
        "alignment": nominal.alignment(runs, segmentation, parameters),
        "primitives": nominal.primitives(runs, primitives, paths),
    }
    if with_feedback := board.read_feedback_runs(files):
        recordings["feedback"] = board.executions(with_feedback)
        recordings["robot"] = board.robot(with_feedback[max(with_feedback)][-1])
    if refined := board.read_refined_runs(files):
        search = (files.table("history"), files.table("rollouts"))
        recordings["refinement"] = board.executions(refined, search)
    publish_recordings("reports/rerun/scraping", recordings)


if __name__ == "__main__":
    run(main)
