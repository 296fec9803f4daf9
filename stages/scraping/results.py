"""Gather the results of the scraping testbed in one table, by person."""

from dissertation.scraping.files import TABLES, ScrapingFiles, read_datasets, read_settings
from dissertation.scraping.protocol import results
from dissertation.scraping.protocol.board_refinement import BoardRefinementParameters
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import read_networks
from structlearn.primitives.fitting import FitParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import read_segmentation


def main() -> None:
    found = ScrapingFiles()
    tables = {name: found.table(name) for name in TABLES if name not in ("rollouts", "refined_traces")}
    segment = stage_parameters("segment", SegmentParameters)
    fit = stage_parameters("fit_primitives", FitParameters)
    force_n = stage_parameters("testbed", TestbedParameters).control.force_n
    refine = stage_parameters("refine", BoardRefinementParameters)
    person = stage_parameters("simulate", DemonstratorParameters).seed
    cuts, demonstrations = read_segmentation("data/segments/scraping"), found.runs("nominal")
    datasets = read_datasets("data/feedback/scraping/dataset")
    corrections, unrolls = read_settings("data/runs/scraping/corrections"), found.runs("unrolls")
    networks = read_networks(f"data/feedback/scraping/models/{POINTWISE}.safetensors")
    parts = [
        results.of_person(person, demonstrations, cuts, corrections, unrolls),
        results.of_cuts(demonstrations, cuts, segment.primitives),
        results.of_primitives(tables, fit.regression),
        results.of_models(tables, networks),
        results.of_executions(tables, datasets, force_n),
        results.of_refinement(tables, refine),
        results.of_searches(tables),
    ]
    with publish("data/results/scraping.parquet") as path:
        write_table(results.scraping_results(person, parts, results.of_sweep(tables)), path)


if __name__ == "__main__":
    run(main)
