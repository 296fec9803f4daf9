"""Learn the primitives of the scraping task and unroll them as a sequence (dissertation IV.3, IV.5.4)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, cross_validation, learn_sequence
from structlearn.primitives.primitive_files import write_primitives
from structlearn.readers.demonstration import read_runs
from structlearn.segmentation.segments import read_segmentation


def main() -> None:
    parameters = stage_parameters("fit_primitives", FitParameters)
    situation = stage_parameters("generalise", sequence.GeneraliseParameters)
    demonstrations = read_runs("data/runs/scraping/nominal.parquet")
    segmentation = read_segmentation("data/segments/scraping")

    primitives = learn_sequence(demonstrations, segmentation.results, parameters)
    dt = demonstrations[0].time[1]
    nominal = sequence.unroll(primitives, dt)
    generalised = sequence.generalised(primitives, dt, situation)
    with publish("data/primitives/scraping") as folder:
        folder.mkdir()
        write_primitives(primitives, folder / "primitives.safetensors")
        for name, path in (("nominal", nominal), ("generalised", generalised)):
            write_table(sequence.sequence_table(path, segmentation.primitives), folder / f"{name}.parquet")
        errors = cross_validation(demonstrations, segmentation.results, parameters)
        write_table(errors, folder / "reproduction.parquet")


if __name__ == "__main__":
    run(main)
