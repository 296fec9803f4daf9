"""Import the demonstrations of touch: the only stage that decodes these recordings (II.4.1.1)."""

from structlearn.core.stage import run, stage_parameters
from structlearn.readers import read_demonstrations
from structlearn.readers.demonstration import write_runs
from structlearn.tactile.touch_dataset import TouchDataParameters


def main() -> None:
    rate_hz = stage_parameters("touch_dataset", TouchDataParameters).rate_hz
    demonstrations = read_demonstrations("data/raw/servoing", rate_hz=rate_hz)
    write_runs(demonstrations, "data/runs/servoing.parquet")


if __name__ == "__main__":
    run(main)
