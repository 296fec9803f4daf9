"""Execute the primitives without feedback, and with it before and after refinement (IV.9.4.2)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.skill import ReactiveSkill, on_axis
from structlearn.readers.demonstration import write_runs
from structlearn.readers.source import ClockParameters
from structlearn.testbeds.scraping.protocol import execution_scores
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters, read_board
from structlearn.testbeds.scraping.protocol.executions import executed_set
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_refinement", execution_scores.EvaluationParameters)
    refinement = stage_parameters("refine", BoardRefinementParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    clock = stage_parameters("clock", ClockParameters)
    board, _ = read_board("data", refinement, supervision, testbed, clock)
    networks = {execution_scores.NOMINAL: {}}
    networks |= {
        model: read_networks(f"{DATA}/refinement/{model}.safetensors")
        for model in (execution_scores.BEFORE, execution_scores.AFTER)
    }

    sets = []
    with publish("data/runs/scraping/refined") as folder:
        folder.mkdir()
        for model, own in networks.items():
            by_axis = on_axis(own, supervision.axis)
            skill = ReactiveSkill(board.primitives, board.expected, by_axis, board.limits)
            executed = executed_set(model, skill, parameters, testbed, clock)
            for setting, runs in executed.runs.items():
                write_runs(runs, folder / model / f"{setting:g}.parquet")
            sets.append(executed)
    with publish(f"{DATA}/refined") as folder:
        folder.mkdir()
        scores = execution_scores.scores(sets, board.nominal, supervision)
        write_table(scores, folder / "scores.parquet")
        write_table(execution_scores.traces(sets, board.expected, supervision), folder / "traces.parquet")


if __name__ == "__main__":
    run(main)
