"""Names, order and colours of what is compared on recorded data, for pages and recordings alike.

Keys are those of the protocols' tables; they stand here as text, so that drawing does not import what learns.
"""

from structlearn.palette import (
    BLACK,
    BLUE,
    DEMONSTRATION_COLOUR,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    REPRODUCTION_COLOUR,
    SKY,
    VERMILION,
    Look,
)
from structlearn.rigid_body.model_names import DEFAULT
from structlearn.rigid_body.model_names import NAMES as MODEL_NAMES

RECORDED = Look("recorded", DEMONSTRATION_COLOUR)
LEARNED = Look("primitive", REPRODUCTION_COLOUR)
"""A primitive unrolled beside what it was learned from."""

PATHS = {
    "recorded": RECORDED,
    "nominal": Look("nominal primitive", BLUE),
    "coupling": Look("with learned coupling", REPRODUCTION_COLOUR),
    "spread": Look("mean of the reaches learned from", BLACK),
}
"""Of the higher reaches; tables hold distances to the last three as `KEY_mm`."""

SLIDE_GROUPS = {
    "learned": Look("this material", BLUE),
    "left out": Look("fault of the sensor", ORANGE),
    "other material": Look("other material", VERMILION),
}
"""Trials of the slides."""

TOUCH_MODELS = {
    "structured": Look("structured latent space", BLUE),
    "reconstruction only": Look("latent space without structure", ORANGE),
    "3 principal components": Look("3 principal components", GREY),
}

SKIN_MODELS = TOUCH_MODELS | {"Gaussian process": Look("Gaussian process on all channels", GREEN)}

SKIN_NEW_BLOCKS, SKIN_NEW_PRESSES, SKIN_NEW_RUN = "new blocks", "new presses", "new run"
SKIN_SERVO, SKIN_SERVO_TEXT = "NJ, corrected", ("LL", "NG", "NJ")
SKIN_FORCE = {
    "channels and their products": Look("ridge regression, channels and their products", BLUE),
    "pressure alone": Look("pressure alone", GREY),
    "Gaussian process": SKIN_MODELS["Gaussian process"],
}
"""Keys of the magnetic skin's tables."""

TOUCH_ASKED = (
    ("slides", "slides", "new trials"),
    ("slides", "slides", "new material"),
    ("slides", "slides", "new material, standardised by itself"),
    ("unscrewing", "unscrewing", "new trials"),
    ("simulated", "simulated", "new trials"),
    ("simulated, magnitudes", "simulated, magnitudes", "new trials"),
    ("simulated, magnitudes", "slides", "new set"),
    ("slides", "simulated, magnitudes", "new set"),
    ("simulated", "unscrewing", "new set"),
    ("unscrewing", "simulated", "new set"),
)
"""What was learned from, what was asked about, and what was new in it; in the order of tables."""

DYNAMICS_MODELS = {"urdf": MODEL_NAMES[DEFAULT]} | MODEL_NAMES | {"least_squares": "least squares"}

FRICTIONS = {
    "none": "",
    "viscous": "viscous",
    "coulomb": "viscous, Coulomb",
    "offset": "viscous, Coulomb, offset",
}

DYNAMICS_LOOKS = {
    ("urdf", "none"): Look(DYNAMICS_MODELS["urdf"], GREY),
    ("mlp", "none"): Look("MLP", VERMILION),
    ("mlp_scaled", "none"): Look("MLP, scaled", ORANGE),
    ("delan", "viscous"): Look("DeLaN", PURPLE),
    ("cov", "viscous"): Look("Cov, viscous", SKY),
    ("cov", "coulomb"): Look("Cov, Coulomb", BLUE),
    ("cov", "offset"): Look("Cov, Coulomb, offset", GREEN),
    ("least_squares", "coulomb"): Look("least squares, Coulomb", BLACK),
}
"""Models of the Panda with their friction, as figures show them."""

TOUCH_WORLDS = {
    "scraping, recorded": BLACK,
    "scraping, simulated": VERMILION,
    "unscrewing, recorded": PURPLE,
    "slides, recorded": GREEN,
}
"""Colours of the sets of touch that are set beside each other."""
