"""Compare our feedback with policies without structure on the same demonstrations of one person."""

from dissertation.evidence.results import FOLDER
from dissertation.rivals.imitation_data import learned_bench, record
from dissertation.rivals.protocol import ComparisonParameters, MethodParameters, compare
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    people = stage_parameters("simulate", DemonstratorParameters)
    bench = learned_bench(
        people,
        drawn_testbed(stage_parameters("testbed", TestbedParameters)),
        stage_parameters("clock", ClockParameters),
        stage_parameters("segment", SegmentParameters),
        stage_parameters("fit_primitives", FitParameters),
        stage_parameters("coupling_dataset", SupervisionParameters),
        parameters.demonstrations,
    )
    methods = stage_parameters("rival_methods", MethodParameters)
    recorded = record(bench, parameters.demonstrations)
    results = compare(people.seed, bench, recorded, parameters, methods)
    with publish(FOLDER / "rivals.parquet") as path:
        write_table(results, path)


if __name__ == "__main__":
    run(main)
