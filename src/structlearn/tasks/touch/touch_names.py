"""Names of models, sets and controllers of touch, and their looks on pages and in recordings."""

from collections.abc import Sequence
from typing import Literal

import pandas as pd

from structlearn.palette import BAD, BLUE, GREY, OCHRE, PINK, Look

# latent spaces and their rivals, which see the same channels
STRUCTURED, PLAIN = "structured", "reconstruction only"
COMPONENTS, PROCESS = "3 principal components", "Gaussian process"
SPACES = {
    STRUCTURED: Look("structured latent space", BLUE),
    PLAIN: Look("latent space without structure", OCHRE),
    COMPONENTS: Look("3 principal components", GREY),
    PROCESS: Look("Gaussian process on all channels", PINK),
}

# models of force; the pressure of a magnetic skin is the norm of all its channels
QUADRATIC, PRESSURE = "channels and their products", "pressure alone"
FORCE_MODELS = {
    QUADRATIC: Look("ridge regression, channels and their products", BLUE),
    PRESSURE: Look("pressure alone", GREY),
    PROCESS: SPACES[PROCESS],
}

# what is new in the test samples; a new run is always standardised by itself
NEW_BLOCKS, NEW_PRESSES, NEW_RUN = "new blocks", "new presses", "new run"

# controllers: the dissertation's, and ours that rests where it is and corrects its model
PUBLISHED_SERVO: tuple[Literal["LL", "NG", "NJ"], ...] = ("LL", "NG", "NJ")
ADAPTIVE = "NJ, adaptive"

# trials of slides over materials
SLIDE_GROUPS = {
    "learned": Look("this material", BLUE),
    "left out": Look("fault of the sensor", BAD),
    "other material": Look("other material", PINK),
}


def material_of(trial: str) -> str:
    """Material of a trial, e.g. `mat9` for `mat9_1`."""
    return trial.rpartition("_")[0]


def shown_map(maps: pd.DataFrame, tuned_on: Sequence[str]) -> pd.DataFrame:
    """Map of the skin to show: the first tested on a run not used for tuning."""
    untouched = maps[~maps["test_run"].isin(tuned_on)]
    maps = untouched if len(untouched) else maps
    return of_pair(maps, maps)


def of_pair(table: pd.DataFrame, first: pd.DataFrame) -> pd.DataFrame:
    """Rows of a table whose training and test run are those of the first row of `first`."""
    keys = ["learned_from", "test_run"]
    return table[(table[keys] == first[keys].iloc[0]).all(axis=1)]
