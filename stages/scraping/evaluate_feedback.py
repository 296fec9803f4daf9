"""Execute the primitives on every setting, without and with each feedback model (IV.9.3.5)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.corrected_paths import path_errors
from structlearn.feedback.coupling_model import read_networks
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.feedback_models import MODELS
from structlearn.feedback.skill import Limits, ReactiveSkill, largest_coupling, on_axis
from structlearn.primitives.primitive_files import read_primitives
from structlearn.readers.demonstration import read_runs, write_runs
from structlearn.readers.source import ClockParameters
from structlearn.testbeds.scraping.files import read_datasets, read_expected
from structlearn.testbeds.scraping.protocol import execution_scores
from structlearn.testbeds.scraping.protocol.execution_scores import nominal_orientation
from structlearn.testbeds.scraping.protocol.executions import executed_set
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_feedback", execution_scores.EvaluationParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    clock = stage_parameters("clock", ClockParameters)
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    expected, datasets = read_expected(f"{DATA}/expected"), read_datasets(f"{DATA}/dataset")
    networks = {model: read_networks(f"{DATA}/models/{model}.safetensors") for model in MODELS}

    sets = []
    with publish("data/runs/scraping/closed_loop") as folder:
        folder.mkdir()
        largest = largest_coupling([one.target for one in datasets.values()])
        limits = Limits(largest_coupling={supervision.axis: largest})
        for model in (execution_scores.NOMINAL, *MODELS):
            own = on_axis(networks.get(model, {}), supervision.axis)
            skill = ReactiveSkill(primitives, expected, own, limits)
            executed = executed_set(model, skill, parameters, testbed, clock)
            for setting, runs in executed.runs.items():
                write_runs(runs, folder / model / f"{setting:g}.parquet")
            sets.append(executed)
    with publish(f"{DATA}/evaluation") as folder:
        folder.mkdir()
        unrolls = read_runs("data/runs/scraping/unrolls.parquet")
        scores = execution_scores.scores(sets, nominal_orientation(unrolls), supervision)
        write_table(scores, folder / "scores.parquet")
        write_table(execution_scores.traces(sets, expected, supervision), folder / "traces.parquet")
        write_table(path_errors(datasets, networks), folder / "path_errors.parquet")


if __name__ == "__main__":
    run(main)
