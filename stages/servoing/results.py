"""Results of the servoing testbed as one table."""

from dissertation.servoing import files
from dissertation.servoing.protocol.results import servoing_results
from dissertation.servoing.protocol.servo_variants import ServoTrialParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.artefacts import read_table, write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    person = stage_parameters("toucher", ToucherParameters).seed
    tolerated_mm = stage_parameters("servo", ServoTrialParameters).tolerance.position_mm
    truth = read_table(files.MADE_BY["contacts"][0])
    results = servoing_results(person, tolerated_mm, truth, files.tables("models"), files.tables("loops"))
    write_table(results, "data/results/servoing.parquet")


if __name__ == "__main__":
    run(main)
