"""Names, order and colours of models, sources and situations, for the page and the recordings.

A picture colours either kinds of models (`KINDS`) or what they learned from (`SOURCES`), never both.
"""

from dissertation.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    LIMITED,
    MOVING,
    NO_MODEL,
    PAIR,
    TRAINED,
    UNSEEN,
)
from dissertation.obstacles.protocol.avoidance_protocols import (
    PUBLISHED as PUBLISHED_RULES,
)
from structlearn.avoidance.learned_models import (
    ALL,
    ENSEMBLE,
    HUMAN_INSPIRED,
    NETWORK,
    PHASE_MODULATED,
    SETTING,
)
from structlearn.palette import (
    BAD,
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT_BLUE,
    LIGHT_GREY,
    OCHRE,
    OURS,
    PINK,
    PUBLISHED,
    Look,
)

KINDS = {
    NO_MODEL: Look("no avoidance", BLACK),
    NETWORK: Look("network", PUBLISHED),
    ENSEMBLE: Look("ensemble", OURS),
    PHASE_MODULATED: Look("phase-modulated network", LIGHT_BLUE),
    HUMAN_INSPIRED: Look("Rai et al.", PINK),
}
"""Kinds of models, in table order."""

SOURCES = {
    "": Look("no avoidance", LIGHT_GREY),
    SETTING: Look("per setting", BLUE),
    "sphere": Look("sphere", LIGHT_BLUE),
    "cube": Look("cube", OCHRE),
    "cylinder": Look("cylinder", GREEN),
    ALL: Look("all shapes", PINK),
}
"""What a model learned from. No avoidance is light grey on the recordings' dark ground, black on the page."""

DEMONSTRATIONS = Look("demonstrations", GREY)

HIT = Look("obstacle that the reach without avoidance hits", BAD)
FREE = Look("obstacle that it does not hit", GREY)

SITUATIONS = {
    TRAINED: "trained obstacle",
    UNSEEN: "unseen sphere",
    MOVING: "moving sphere",
    PAIR: "two spheres",
    GOAL_CHANGE: "moving goal",
}

RULES = {PUBLISHED_RULES: "the published rules", LIMITED: "limits at the goal"}
"""Rules that limit a coupling term before it is applied."""


def fitted_name(kind: str, learned_from: str) -> str:
    """Kind of a model and what it learned from, e.g. `network, sphere`."""
    return f"{KINDS[kind].name}, {SOURCES[learned_from].name}" if learned_from else KINDS[kind].name
