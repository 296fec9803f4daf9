"""Look at recordings before anything is configured: `python -m structlearn.inspect ~/bags`.

Prints what the files hold, whether they are fit to be learned from, and an entry of `stages/tasks/own.yaml`.
Nothing is written but what `--output` names. The exit code is 1 where nothing could be read, and 0 otherwise,
whatever the doubts.
"""

import argparse
from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run
from structlearn.tasks.own.survey_report import as_yaml, find_out, report


def main() -> None:
    """Print the report; publish the proposed entry where a file is named for it."""
    given = _arguments()
    found = find_out(given.source, given.urdf)
    print(report(found), end="")
    if given.output is not None and found.proposal is not None:
        with publish(given.output) as path:
            path.write_text(as_yaml(found.proposal), encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="inspect", description="Look at recordings before configuring.")
    parser.add_argument("source", help="a file, a bag, or a folder of them")
    parser.add_argument("--urdf", help="the robot, where poses are to be computed from its joints")
    parser.add_argument("--output", type=Path, help="file for the proposed entry")
    return parser.parse_args()


if __name__ == "__main__":
    run(main)
