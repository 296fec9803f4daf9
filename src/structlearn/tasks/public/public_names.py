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
    SCENE_WAYS,
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

REPRESENTATIONS = {
    "human_inspired": "human-inspired (Rai et al.)",
    "network_validation": "network, as published",
    "ridge": "ridge regression",
    "network": "network",
    "ensemble": "ensemble of networks",
    "pmnn": "phase-modulated network",
}
"""Of the coupling term past obstacles; the text's network stops when validation samples say so."""

INPUTS = {
    "features": Look("features", GREY),
    "phase_velocity": Look("features, phase velocity", ORANGE),
    "phase": Look("features, phase and its velocity", BLUE),
}
"""What a representation sees."""

BOX_WAYS = {"recorded": Look("person", DEMONSTRATION_COLOUR)} | SCENE_WAYS
"""Ways past boxes: who or what moves the hand."""

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
