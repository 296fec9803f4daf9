"""All that is found out about recordings before anything is configured."""

from dataclasses import dataclass

from structlearn.testbeds.own.protocol.fitness import Answer, fitness
from structlearn.testbeds.own.protocol.hand_choice import Candidate, candidates
from structlearn.testbeds.own.protocol.inspection import SourceSeen, look_at
from structlearn.testbeds.own.protocol.motion_survey import MotionSurvey, survey_motion
from structlearn.testbeds.own.protocol.proposal import Proposal, propose


@dataclass(frozen=True)
class Findings:
    """What a source holds, and what follows from it.

    Attributes:
        seen: its files.
        sources: of poses, the one that is taken for the hand's first.
        motion: runs of motion of the hand; None where it does not move.
        proposal: an entry of the parameter file; None where nothing could be the hand's pose.
        answers: whether the files are fit to be learned from.
    """

    seen: SourceSeen
    sources: tuple[Candidate, ...]
    motion: MotionSurvey | None
    proposal: Proposal | None
    answers: tuple[Answer, ...]


def find_out(source: str, urdf: str | None = None) -> Findings:
    """Look at a source.

    Args:
        source: as `recording_files` takes it.
        urdf: file of the robot, from whose joints poses may be computed.

    Raises:
        InputError: as `look_at`.
    """
    seen = look_at(source, urdf)
    found = candidates(seen.files)
    hand, others = (found[0] if found else None), found[1:]
    motion = survey_motion(hand.paths) if hand is not None and hand.moves else None
    proposal = propose(seen, hand, others, motion) if hand is not None else None
    answers = fitness(seen, hand, motion, proposal.read if proposal is not None else ())
    sources = (hand, *others) if hand is not None else ()
    return Findings(seen, sources, motion, proposal, tuple(answers))
