"""Supervised data for feedback: sensor deviations and coupling terms of corrections (IV.6.2, IV.9.1.3)."""

from dissertation.scraping.files import ScrapingFiles, read_expected, read_settings
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_dataset import to_table
from structlearn.feedback.coupling_targets import (
    SupervisionParameters,
    coupling_dataset,
    level_dataset,
    require_parts,
)
from structlearn.primitives.primitive_files import read_primitives
from structlearn.segmentation.segments import commanded_cuts

FILES = ScrapingFiles()


def main() -> None:
    parameters = stage_parameters("coupling_dataset", SupervisionParameters)
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    names = [primitive.name for primitive in primitives]
    expected = read_expected("data/feedback/scraping/expected")
    corrections = read_settings("data/runs/scraping/corrections")
    require_parts(parameters.primitives, primitives, expected)
    cuts = {setting: commanded_cuts(runs, names) for setting, runs in corrections.items()}

    with publish("data/feedback/scraping/dataset") as folder:
        folder.mkdir()
        for name in parameters.primitives:
            primitive = primitives[names.index(name)]
            own = {setting: parts[name] for setting, parts in cuts.items()}
            datasets, checks = coupling_dataset(corrections, own, primitive, expected[name], parameters)
            write_table(to_table(datasets[parameters.axis]), folder / f"{name}.parquet")
            write_table(checks, folder / f"checks_{name}.parquet")

    with publish("data/feedback/scraping/level") as folder:
        folder.mkdir()
        level = [*FILES.runs("unrolls"), *FILES.runs("level")]
        level_cuts = commanded_cuts(level, names)
        for name in parameters.primitives:
            dataset = level_dataset(level, level_cuts[name], expected[name], parameters)
            write_table(to_table(dataset), folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
