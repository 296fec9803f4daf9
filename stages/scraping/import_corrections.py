"""Import the corrected demonstrations: the only stage that decodes these recordings (IV.9.1.3, iii)."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import read_demonstrations
from structlearn.readers.demonstration import write_runs
from structlearn.readers.source import ClockParameters


def main() -> None:
    clock = stage_parameters("clock", ClockParameters)
    with publish("data/runs/scraping/corrections") as folder:
        folder.mkdir()
        for setting in sorted(Path("data/raw/scraping/corrections").iterdir()):
            corrected = read_demonstrations(setting, **clock.model_dump())
            write_runs(corrected, folder / f"{setting.name}.parquet")


if __name__ == "__main__":
    run(main)
