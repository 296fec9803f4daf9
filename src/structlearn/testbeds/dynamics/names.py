"""Titles, colours and lines of dynamics models, on the page and in recordings.

Printed names of the models are in `rigid_body.model_names`. The colours can be distinguished on the page's
white background and on the viewer's dark one.
"""

from typing import Any

from structlearn.palette import BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, WHITE
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.trainings import OURS, PUBLISHED

SINE, REACH = "sine", "reach"  # tasks
SHOWN_TRAINING = OURS  # of the models whose reaches and torques are shown: networks learn best in it

ROBOT_TITLES = {IDEAL: "Arm as in its URDF", ROBOT: "Perturbed robots (simulated)"}
FORM_TITLES = {PUBLISHED: "As published", OURS: "Our training"}
LOSS_TITLES = {"raw": "Raw loss (as published)", "normalised": "Loss normalised per joint"}

REFERENCE = WHITE  # of references, drawn wide: a wanted path, a measured torque, a carried mass
PAYLOAD = ORANGE
WITH_COULOMB = LIGHT_BLUE  # of every structure that learned Coulomb friction too

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
"""Colour and line of each model; known models are grey."""


def colour(model: str) -> str:
    """Colour of a model, `#rrggbb`."""
    return WITH_COULOMB if model.endswith(COULOMB) else LOOKS[model][0]


def look(model: str) -> dict[str, Any]:
    """Colour and line of a model, for matplotlib."""
    return {"color": colour(model), "linestyle": LOOKS[model.removesuffix(COULOMB)][1]}
