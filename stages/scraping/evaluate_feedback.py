"""Execute the primitives on every setting, without and with each feedback model (IV.9.3.5)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.corrected_paths import path_errors
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.feedback_models import MODELS
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling
from structlearn.primitives.primitive_files import read_primitives
from structlearn.readers.demonstration import read_runs
from structlearn.readers.source import ClockParameters
from structlearn.testbeds.scraping.files import read_datasets, read_expected
from structlearn.testbeds.scraping.protocol.execution_scores import (
    NOMINAL,
    ExecutionParameters,
    nominal_orientation,
)
from structlearn.testbeds.scraping.protocol.executions import evaluate
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_feedback", ExecutionParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    clock = stage_parameters("clock", ClockParameters)
    datasets = read_datasets(f"{DATA}/dataset")
    models = {model: read_networks(f"{DATA}/models/{model}.safetensors") for model in MODELS}
    largest = largest_coupling([one.target for one in datasets.values()])
    skill = ReactiveSkill(
        read_primitives("data/primitives/scraping/primitives.safetensors"),
        read_expected(f"{DATA}/expected"),
        limits=Limits(largest_coupling={supervision.axis: largest}),
    )
    nominal = nominal_orientation(read_runs("data/runs/scraping/unrolls.parquet"))

    with publish("data/runs/scraping/closed_loop") as folder:
        every = {NOMINAL: {}} | models
        scores, traces = evaluate(every, skill, parameters, supervision, testbed, clock, nominal, folder)
    with publish(f"{DATA}/evaluation") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(traces, folder / "traces.parquet")
        write_table(path_errors(datasets, models), folder / "path_errors.parquet")


if __name__ == "__main__":
    run(main)
