"""Where public recordings come from, and the clock that demonstrations are read on."""

import os
from pathlib import Path

from pydantic import Field

from structlearn.ground.params import Parameters

PUBLIC_SOURCE_VARIABLE = "RECORDED_DATA"


class PublicSourceParameters(Parameters):
    """Source of the public recordings."""

    source: str = Field(min_length=1)
    reaches: str = Field(min_length=1)
    corrected_reaches: str = Field(min_length=1)
    scraping: str | None = Field(min_length=1)
    slide_trials: int | None = Field(ge=1)

    @property
    def folder(self) -> Path:
        """The folder to import from."""
        return Path(os.environ.get(PUBLIC_SOURCE_VARIABLE) or self.source)


class ClockParameters(Parameters):
    """The one clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)
