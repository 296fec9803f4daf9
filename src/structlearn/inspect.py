"""Look at recordings before anything is configured: `python -m structlearn.inspect ~/bags`.

Prints what the files hold, whether they are fit to be learned from, and an entry of `stages/own/params.yaml`.
Nothing is written but what `--output` names. The exit code is 1 where nothing could be read, and 0 otherwise,
whatever the doubts.
"""

import argparse
from pathlib import Path

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run
from structlearn.testbeds.own.protocol.fitness import fitness
from structlearn.testbeds.own.protocol.hand_choice import candidates
from structlearn.testbeds.own.protocol.inspection import look_at
from structlearn.testbeds.own.protocol.motion_survey import survey_motion
from structlearn.testbeds.own.protocol.proposal import propose
from structlearn.testbeds.own.survey_report import as_yaml, report


def main() -> None:
    """Print the report; publish the proposed entry where a file is named for it."""
    given = _arguments()
    seen = look_at(given.source, given.urdf)
    sources = candidates(seen.files)
    hand = sources[0] if sources else None
    motion = survey_motion(hand.paths) if hand is not None and hand.moves else None
    proposal = propose(seen, hand, sources[1:], motion)
    answers = fitness(seen, hand, motion, proposal.read if proposal is not None else ())
    print(report(seen, sources, motion, answers, proposal), end="")
    if given.output is not None and proposal is not None:
        with publish(given.output) as path:
            path.write_text(as_yaml(proposal), encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="inspect", description="Look at recordings before configuring.")
    parser.add_argument("source", help="a file, a bag, or a folder of them")
    parser.add_argument("--urdf", help="the robot, where poses are to be computed from its joints")
    parser.add_argument("--output", type=Path, help="file for the proposed entry")
    return parser.parse_args()


if __name__ == "__main__":
    run(main)
