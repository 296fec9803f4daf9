"""What is chosen for feedback from your own corrections."""

from pydantic import Field

from structlearn.feedback.coupling_model import NetworkParameters, TrainingParameters
from structlearn.feedback.supervision import CorrectionParameters
from structlearn.recordings.settings import Setting


class OwnFeedbackParameters(CorrectionParameters, NetworkParameters):
    """Executions and corrected ones, and the feedback learned from them.

    Fields: `stages/own/params.yaml`, `feedback`.
    """

    executions: str = Field(min_length=1)
    corrections: str = Field(min_length=1)
    settings: tuple[Setting, ...] = Field(min_length=1)
    expected_hz: float = Field(gt=0)
    training: TrainingParameters
    parts: int = Field(ge=2)
