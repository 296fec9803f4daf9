"""Import the nominal demonstrations: the only stage that decodes these recordings (IV.9.1.3, step i)."""

from structlearn.core.stage import run, stage_parameters
from structlearn.readers import read_demonstrations
from structlearn.readers.demonstration import write_runs
from structlearn.readers.source import ClockParameters


def main() -> None:
    clock = stage_parameters("clock", ClockParameters)
    demonstrations = read_demonstrations("data/raw/scraping/nominal", **clock.model_dump())
    write_runs(demonstrations, "data/runs/scraping/nominal.parquet")


if __name__ == "__main__":
    run(main)
