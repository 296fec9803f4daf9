"""The simulated board with the skill that was learned for it, put together from what the stages wrote."""

from collections.abc import Sequence
from pathlib import Path

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.skill import Limits, largest_coupling
from structlearn.feedback.supervision import SupervisionParameters
from structlearn.recordings.source import ClockParameters
from structlearn.testbeds.scraping.files import ScrapingFiles
from structlearn.testbeds.scraping.protocol.board_rollouts import Board
from structlearn.testbeds.scraping.protocol.execution_scores import nominal_orientation
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def read_board(
    data: str | Path,
    settings_deg: Sequence[float],
    setting_deg: float,
    supervision: SupervisionParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> tuple[Board, dict[str, CouplingDataset]]:
    """The board of the first primitive with feedback, and the demonstrations.

    `settings_deg`: rolls that demonstrations are read of; their coupling terms bound those of the feedback.
    Returns the board and the demonstrations by primitive. Raises InputError: a file is missing or not
    readable, or a setting was not recorded.
    """
    files = ScrapingFiles(Path(data))
    datasets = files.datasets(settings_deg)
    largest = largest_coupling([one.target for one in datasets.values()])
    board = Board(
        primitives=files.primitives(),
        expected=files.expected(),
        preceding={},
        name=supervision.primitives[0],
        setting_deg=setting_deg,
        nominal=nominal_orientation(files.runs("unrolls")),
        supervision=supervision,
        testbed=testbed,
        limits=Limits(largest_coupling={supervision.axis: largest}),
        clock=clock,
    )
    return board, datasets
