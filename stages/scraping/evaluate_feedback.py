"""Execute the primitives in every setting, without and with each feedback model (IV.9.3.5)."""

from dissertation.scraping.protocol.execution_scores import (
    NOMINAL,
    ExecutionParameters,
)
from dissertation.scraping.protocol.executions import evaluate, read_bench
from dissertation.scraping.protocol.feedback_models import MODELS
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.corrected_paths import path_errors
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.readers.source import ClockParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_feedback", ExecutionParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    clock = stage_parameters("clock", ClockParameters)
    models = {model: read_networks(f"{DATA}/models/{model}.safetensors") for model in MODELS}
    bench, datasets = read_bench("data", None, supervision, testbed, clock)

    with publish("data/runs/scraping/closed_loop") as folder:
        scores, traces = evaluate(bench, {NOMINAL: {}} | models, parameters, folder)
    with publish(f"{DATA}/evaluation") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(traces, folder / "traces.parquet")
        write_table(path_errors(datasets, models), folder / "path_errors.parquet")


if __name__ == "__main__":
    run(main)
