"""The clock that demonstrations are read on."""

from pydantic import Field

from structlearn.core.params import Parameters


class ClockParameters(Parameters):
    """The one clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)
