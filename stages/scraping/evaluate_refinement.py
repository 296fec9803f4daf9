"""Execute the primitives without feedback, and with it before and after refinement (IV.9.4.2)."""

from dissertation.scraping.protocol.board_refinement import BoardRefinementParameters, read_board
from dissertation.scraping.protocol.execution_scores import (
    AFTER,
    BEFORE,
    NOMINAL,
    ExecutionParameters,
)
from dissertation.scraping.protocol.executions import evaluate
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.readers.source import ClockParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_refinement", ExecutionParameters)
    refinement = stage_parameters("refine", BoardRefinementParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    clock = stage_parameters("clock", ClockParameters)
    board, _ = read_board("data", refinement, supervision, testbed, clock)
    models = {NOMINAL: {}}
    models |= {model: read_networks(f"{DATA}/refinement/{model}.safetensors") for model in (BEFORE, AFTER)}

    with publish("data/runs/scraping/refined") as folder:
        scores, traces = evaluate(board, models, parameters, folder)
    with publish(f"{DATA}/refined") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(traces, folder / "traces.parquet")


if __name__ == "__main__":
    run(main)
