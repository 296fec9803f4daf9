"""Results of the servoing testbed as one table."""

from dissertation.servoing import files
from dissertation.servoing.protocol.results import servoing_results
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.artefacts import write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    person = stage_parameters("toucher", ToucherParameters).seed
    results = servoing_results(person, files.tables("models"), files.tables("loops"))
    write_table(results, "data/results/servoing.parquet")


if __name__ == "__main__":
    run(main)
