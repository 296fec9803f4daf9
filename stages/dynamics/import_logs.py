"""Read the logs of joints: the only stage that opens these recordings (III.4)."""

from structlearn.ground.stage import run
from structlearn.recordings.joint_log import read_joint_logs, write_log_table
from structlearn.testbeds.dynamics.files import LOGS, RAW


def main() -> None:
    for recorded in sorted(RAW.iterdir()):
        write_log_table(read_joint_logs(recorded), LOGS / f"{recorded.name}.parquet")


if __name__ == "__main__":
    run(main)
