"""How dynamics models look, on the page and in recordings: one colour, one line and one place for each.

Names of the models for people are those of `rigid_body.model_names`. The colours can be told apart on the
page's white ground and on the viewer's dark one.
"""

from typing import Any

from structlearn.palette import BLUE, GREEN, GREY, LIGHT_BLUE, OCHRE, ORANGE, PINK, WHITE
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.trainings import OURS, TEXT

SINE, REACH = "sine", "reach"  # tasks

ROBOT_TITLES = {IDEAL: "Arm as in its URDF", ROBOT: "The stand-ins (simulated)"}

FORM_TITLES = {TEXT: "As published", OURS: "Our training"}

SHOWN_FORM = OURS  # of the models whose reaches and torques are shown: in it networks learned what they can

LOSS_TITLES = {"raw": "Raw loss (as published)", "normalised": "Loss normalised per joint"}

REFERENCE = WHITE
"""Of what a model is held against, drawn wide: a wanted path, a measured torque, a carried mass."""

PAYLOAD = ORANGE

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
"""Colour and line of each model; what is known instead of learned is grey."""

WITH_COULOMB = LIGHT_BLUE  # of every structure that learned Coulomb friction too


def colour(model: str) -> str:
    """Colour of a model, `#rrggbb`."""
    return WITH_COULOMB if model.endswith(COULOMB) else LOOKS[model][0]


def look(model: str) -> dict[str, Any]:
    """Colour and line of a model, for matplotlib."""
    return {"color": colour(model), "linestyle": LOOKS[model.removesuffix(COULOMB)][1]}
