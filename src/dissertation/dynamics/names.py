"""Titles, colours and line styles of dynamics models, for the page and the recordings.

Display names of the models are in `rigid_body.model_names`. The colours are distinguishable on the page's
white background and on the viewer's dark one.
"""

from collections.abc import Mapping
from typing import Any

from dissertation.dynamics.protocol.forms import CHOSEN, PLAIN
from structlearn.palette import BLUE, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, WHITE
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT

SINE, REACH = "sine", "reach"  # tasks
SHOWN_TRAINING = CHOSEN  # training form of the models in pictures

ROBOT_TITLES = {IDEAL: "Arm as in its URDF", ROBOT: "Perturbed robots (simulated)"}
FORM_TITLES: Mapping[str, str] = {CHOSEN: "Chosen training", PLAIN: "Plain loss"}
LOSS_TITLES = {"normalised": "Loss normalised per joint", "raw": "Raw loss (eq. III.2 as printed)"}

REFERENCE = WHITE  # references, drawn wide: desired paths, measured torques, carried masses
PAYLOAD = PINK
WITH_COULOMB = LIGHT_BLUE  # all structures that also learned Coulomb friction

LOOKS = {
    GROUND_TRUTH: (GREY, "-"),
    DEFAULT: (GREY, "-"),
    "mlp": (ORANGE, "-"),
    "mlp_scaled": (ORANGE, "--"),
    "delan": (PINK, "-"),
    "nostr": (OCHRE, "-"),
    "symm": (OCHRE, "--"),
    "spd": (BLUE, ":"),
    "tri": (BLUE, "--"),
    "cov": (BLUE, "-"),
}
"""Colour and line style of each model; models that are not learned are grey."""


def colour(model: str) -> str:
    """Colour of a model, `#rrggbb`."""
    return WITH_COULOMB if model.endswith(COULOMB) else LOOKS[model][0]


def look(model: str) -> dict[str, Any]:
    """Colour and line style of a model, as matplotlib keywords."""
    return {"color": colour(model), "linestyle": LOOKS[model.removesuffix(COULOMB)][1]}
