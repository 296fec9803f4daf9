"""What models, sets and controllers of touch are called, and how they look on pages and in recordings."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from structlearn.palette import BLACK, BLUE, GREEN, GREY, OCHRE, ORANGE, PINK, Look

if TYPE_CHECKING:
    import pandas as pd

STRUCTURED, PLAIN, COMPONENTS, PROCESS = (
    "structured",
    "reconstruction only",
    "3 principal components",
    "Gaussian process",
)
SPACES = {
    STRUCTURED: Look("structured latent space", BLUE),
    PLAIN: Look("latent space without structure", OCHRE),
    COMPONENTS: Look("3 principal components", GREY),
    PROCESS: Look("Gaussian process on all channels", GREEN),
}
"""Latent spaces and their rivals, which see the same channels."""

QUADRATIC, PRESSURE = "channels and their products", "pressure alone"
FORCE_MODELS = {
    QUADRATIC: Look("ridge regression, channels and their products", BLUE),
    PRESSURE: Look("pressure alone", GREY),
    PROCESS: SPACES[PROCESS],
}
"""Of forces; the pressure of a magnetic skin is the norm of all its channels."""

NEW_BLOCKS, NEW_PRESSES, NEW_RUN = "new blocks", "new presses", "new run"
NEW_TRIALS, NEW_MATERIAL, NEW_SET = "new trials", "new material", "new set"
OWN_UNITS = "new material, standardised by itself"
"""What is new in the touches that are tested on; a new set is always standardised by itself."""

TEXT_SERVO: tuple[Literal["LL", "NG", "NJ"], ...] = ("LL", "NG", "NJ")
CORRECTED = "NJ, corrected"
"""Controllers: the dissertation's, and ours that rests where it is and learns from what its steps missed."""

SLIDES, UNSCREWING, SCRAPING, SIMULATED = "slides", "unscrewing", "scraping", "simulated"
MAGNITUDES = "simulated, magnitudes"
"""Sets of touches; of `MAGNITUDES` only the size of the changes is kept, as of the slides."""

PARTNERS = {SLIDES: MAGNITUDES, MAGNITUDES: SLIDES, UNSCREWING: SIMULATED, SIMULATED: UNSCREWING}
"""Per set, the one that is tested on after it was learned from."""

ASKED = (
    (SLIDES, SLIDES, NEW_TRIALS),
    (SLIDES, SLIDES, NEW_MATERIAL),
    (SLIDES, SLIDES, OWN_UNITS),
    *((name, name, NEW_TRIALS) for name in (UNSCREWING, SIMULATED, MAGNITUDES)),
    (MAGNITUDES, SLIDES, NEW_SET),
    (SLIDES, MAGNITUDES, NEW_SET),
    (SIMULATED, UNSCREWING, NEW_SET),
    (UNSCREWING, SIMULATED, NEW_SET),
)
"""Learned from, tested on, and what was new in it, in the order of tables."""

SLIDE_GROUPS = {
    "learned": Look("this material", BLUE),
    "left out": Look("fault of the sensor", OCHRE),
    "other material": Look("other material", ORANGE),
}
"""Trials of slides over materials."""

REFERENCE = "scraping, recorded"
CALIBRATED = "scraping, simulated"
WORLDS = {
    REFERENCE: BLACK,
    CALIBRATED: ORANGE,
    "unscrewing, recorded": PINK,
    "slides, recorded": GREEN,
}
"""Colours of the sets whose statistics are compared; the first two are of the same task."""


def shown_map(maps: "pd.DataFrame", tuned_on: Sequence[str]) -> "pd.DataFrame":
    """The map of the skin that is shown: the first that is tested on a run on which nothing was tuned."""
    untouched = maps[~maps["asked_about"].isin(tuned_on)]
    maps = untouched if len(untouched) else maps
    first = maps[["learned_from", "asked_about"]].iloc[0]
    return maps[(maps[["learned_from", "asked_about"]] == first).all(axis=1)]
