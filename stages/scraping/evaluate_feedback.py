"""Execute the primitives on every setting, without and with each feedback model (IV.9.3.5)."""

from structlearn.artefacts import publish, write_table
from structlearn.feedback import closed_loop, models
from structlearn.feedback.cost import nominal_orientation
from structlearn.feedback.pmnn import read_networks
from structlearn.feedback.runtime import Limits, largest_coupling
from structlearn.feedback.skill import ReactiveSkill
from structlearn.feedback.storage import read_datasets, read_expected
from structlearn.feedback.supervision import SupervisionParameters
from structlearn.primitives.storage import read_primitives
from structlearn.recordings import read_demonstrations, write_recordings
from structlearn.recordings.source import ClockParameters, SourceParameters
from structlearn.simulation.evaluation import executed_set
from structlearn.simulation.trials import TestbedParameters
from structlearn.stage import run, stage_parameters

DATA = "data/feedback/scraping"


def main() -> None:
    parameters = stage_parameters("evaluate_feedback", closed_loop.EvaluationParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    clock = stage_parameters("clock", ClockParameters)
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    expected, datasets = read_expected(f"{DATA}/expected"), read_datasets(f"{DATA}/dataset")
    networks = {model: read_networks(f"{DATA}/models/{model}.safetensors") for model in models.MODELS}

    sets = []
    with publish("data/raw/scraping/closed_loop") as folder:
        folder.mkdir()
        if datasets and stage_parameters("record", SourceParameters).simulated:
            limits = Limits(largest_coupling=largest_coupling([one.target for one in datasets.values()]))
            for model in (closed_loop.NOMINAL, *models.MODELS):
                own = networks.get(model, {})
                skill = ReactiveSkill(primitives, expected, own, supervision.unit_axis)
                recordings, executed = executed_set(model, skill, parameters, testbed, limits, clock)
                for setting, runs in recordings.items():
                    write_recordings(runs, folder / model / f"{setting:g}")
                sets.append(executed)
    with publish(f"{DATA}/evaluation") as folder:
        folder.mkdir()
        if sets:
            unrolls = read_demonstrations("data/raw/scraping/unrolls", **clock.model_dump())
            scores = closed_loop.scores(sets, nominal_orientation(unrolls), supervision)
            write_table(scores, folder / "scores.parquet")
            write_table(closed_loop.traces(sets, expected, supervision), folder / "traces.parquet")
            write_table(models.path_errors(datasets, networks), folder / "path_errors.parquet")


if __name__ == "__main__":
    run(main)
