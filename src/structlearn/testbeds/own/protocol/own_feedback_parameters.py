"""What is chosen for feedback from your own corrections."""

from pydantic import Field

from structlearn.feedback.supervision import CorrectionParameters
from structlearn.feedback.training_parameters import NetworkParameters, TrainingParameters
from structlearn.recordings.settings import Setting


class OwnFeedbackParameters(CorrectionParameters, NetworkParameters):
    """Executions and corrected ones, and the feedback that is learned from them.

    Attributes:
        executions: file or folder of nominal executions in the default setting; topics are the task's.
        corrections: folder with a sub-folder of corrected demonstrations per setting, named by its label.
        settings: those that are learned from; others that are there only test.
        expected_hz: low-pass of the expected traces; about 12 / duration is what 25 kernels resolve.
        training: of the networks.
        parts: into which the demonstrations are put where a lone setting cannot be left out.
    """

    executions: str = Field(min_length=1)
    corrections: str = Field(min_length=1)
    settings: tuple[Setting, ...] = Field(min_length=1)
    expected_hz: float = Field(gt=0)
    training: TrainingParameters
    parts: int = Field(ge=2)
