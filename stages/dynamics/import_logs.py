"""Import the joint logs: the only stage that decodes these recordings (III.4)."""

from pathlib import Path

from structlearn.core.stage import run
from structlearn.readers.bag_recording import read_joint_logs
from structlearn.readers.joint_log import write_log_table


def main() -> None:
    for recorded in sorted(Path("data/raw/dynamics").iterdir()):
        write_log_table(read_joint_logs(recorded), f"data/runs/dynamics/{recorded.name}.parquet")


if __name__ == "__main__":
    run(main)
