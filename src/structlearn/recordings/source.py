"""Where public recordings come from, and the clock that demonstrations are read on."""

import os
from pathlib import Path

from pydantic import Field

from structlearn.ground.params import Parameters

PUBLIC_SOURCE_VARIABLE = "RECORDED_DATA"


class PublicSourceParameters(Parameters):
    """Source of the public recordings.

    Attributes:
        source: folder that holds `clmc`, `slide`, `panda`, `reaches_past_boxes`, `eflesh` and `ur10e`, or
            some; the environment variable RECORDED_DATA stands in for it, so that the place of the data on
            a machine need not be written into a file under version control.
        reaches: folder of the nominal reaches in `clmc/cart_coord_dmp`, or a pattern of its name.
        corrected_reaches: likewise of those with the same start and goal along a higher arc.
        scraping: folder of the execution in `clmc/scraping`; None: the first that holds primitives.
        slide_trials: the first so many trials of each material are taken; None: all.
    """

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
    """The one clock on which all stages read the demonstrations.

    Attributes:
        rate_hz: ticks per second.
        max_gap_s: longest hole in a stream that is bridged by interpolation.
    """

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)
