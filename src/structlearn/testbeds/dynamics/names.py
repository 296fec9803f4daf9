"""Titles, colours and line styles of dynamics models, for the page and recordings.

Printed names of the models are in `rigid_body.model_names`. The colours are distinguishable on the page's
white background and on the viewer's dark one.
"""

from typing import Any

from structlearn.palette import BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, WHITE
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.trainings import OURS, PUBLISHED

SINE, REACH = "sine", "reach"  # tasks
SHOWN_TRAINING = OURS  # form of the models whose reaches and torques are shown: networks learn best in it

ROBOT_TITLES = {IDEAL: "Arm as in its URDF", ROBOT: "Perturbed robots (simulated)"}
FORM_TITLES = {PUBLISHED: "As published", OURS: "Our training"}
LOSS_TITLES = {"raw": "Raw loss (as published)", "normalised": "Loss normalised per joint"}

REFERENCE = WHITE  # references, drawn wide: a target path, a measured torque, a carried mass
PAYLOAD = ORANGE
WITH_COULOMB = LIGHT_BLUE  # structures that also learned Coulomb friction

LOOKS = {
    GROUND_TRUTH: (GREY, "-"),
    DEFAULT: (GREY, "-"),
    "mlp": (ORANGE, "-"),
    "mlp_scaled": (ORANGE, "--"),
    "delan": (PINK, "-"),
    "nostr": (OCHRE, "-"),
    "symm": (GREEN, "-"),
    "spd": (BLUE, ":"),
    "tri": (BLUE, "--"),
    "cov": (BLUE, "-"),
}
"""Colour and line style of each model; known models are grey."""


def colour(model: str) -> str:
    """Colour of a model, `#rrggbb`."""
    return WITH_COULOMB if model.endswith(COULOMB) else LOOKS[model][0]


def look(model: str) -> dict[str, Any]:
    """Colour and line style of a model, for matplotlib."""
    return {"color": colour(model), "linestyle": LOOKS[model.removesuffix(COULOMB)][1]}
