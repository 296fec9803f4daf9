"""Colours (`#rrggbb`) and names of methods, shared by pages and recordings.

The categorical colours are those of Okabe and Ito, which people with common colour blindness can distinguish,
without yellow; ochre, pink and light blue are darker than theirs, so that every line has a contrast of 3:1 on
white and on the recordings' dark background.

In a picture that compares, green is good and orange bad, as in the verdicts of the pages; grey is what learns
nothing, ochre the dissertation's form, blue ours. Labels that are neither better nor worse (primitives, axes,
shapes, electrodes) take the categorical colours in order.
"""

from typing import NamedTuple

import numpy as np

BLUE = "#0072b2"
OCHRE = "#b58900"
GREEN = "#009e73"
ORANGE = "#d55e00"
PINK = "#c0669a"
LIGHT_BLUE = "#2f9bd8"
BLACK = "#1b1f24"
GREY = "#6f7780"  # context: other demonstrations, true values
LIGHT_GREY = "#8d959d"
WHITE = "#d5d9de"  # only on the recordings' dark background

COLOUR_NAMES = {BLUE: "blue", OCHRE: "ochre", GREEN: "green", ORANGE: "orange", PINK: "pink"}
COLOUR_NAMES |= {LIGHT_BLUE: "light blue", GREY: "grey", LIGHT_GREY: "light grey", WHITE: "white"}


# as it should be: true values, a person's correction; what fails: hit, missed, stopped
GOOD, BAD = GREEN, ORANGE
# nothing learned, the dissertation's form, and ours
WITHOUT, PUBLISHED, OURS = GREY, OCHRE, BLUE


class Look(NamedTuple):
    """Display name and colour, in texts, legends, tables and recordings."""

    name: str
    colour: str


CATEGORICAL_COLOURS = (BLUE, OCHRE, PINK, LIGHT_BLUE, GREEN, ORANGE, BLACK, GREY)

# primitives in temporal order; longer sequences repeat the colours
PRIMITIVE_COLOURS = (BLUE, OCHRE, GREEN, PINK, ORANGE, LIGHT_BLUE)

# x, y, z in time plots
AXIS_COLOURS = (ORANGE, GREEN, BLUE)

# roles of curves
REFERENCE_COLOUR = BLACK
DEMONSTRATION_COLOUR = GREY
REPRODUCTION_COLOUR = OURS

# methods of finding cut points, from the simplest to ours
METHOD_NAMES = {
    "zvc": "zero-velocity crossing",
    "dtw": "time warping",
    "ls": "least squares",
    "wls_published": "weighted, as printed",
    "wls": "weighted, with crossings",
}
METHOD_COLOURS = {"zvc": WITHOUT, "dtw": PINK, "ls": LIGHT_BLUE, "wls_published": PUBLISHED, "wls": OURS}

PHASE_PATHS = {
    "nominal": Look("nominal primitive", PINK),
    "coupling": Look("with learned coupling", REPRODUCTION_COLOUR),
    "spread": Look("mean of the training runs", BLACK),
}
"""Paths that corrected runs are compared with; tables hold the distances to them as `KEY_mm`."""

# what moves the hand through a scene of obstacles, in table order
SCENE_MODELS = {
    "none": Look("baseline alone", BLACK),
    "human_inspired": Look("human-inspired (Rai et al.)", PINK),
    "published": Look("17 features, as published", PUBLISHED),
    "nearest": Look("17 features, our training", LIGHT_BLUE),
    "scene": Look("look ahead at the scene", OURS),
    "planned": Look("planned path, followed", GOOD),
}


def primitive_colour(index: int) -> str:
    """Colour of the primitive at `index` in its sequence."""
    return PRIMITIVE_COLOURS[index % len(PRIMITIVE_COLOURS)]


PLATE_CORNERS = ((BLUE, GREEN), (ORANGE, OCHRE))
"""Colours at a plate's corners, by x and y; positions in between are blended."""


def place_colours(places: np.ndarray) -> np.ndarray:
    """Colours (N, 3) uint8 of positions (N, 2) on a plate."""
    corners = np.array([[[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in row] for row in PLATE_CORNERS])
    part = (places - places.min(axis=0)) / np.maximum(np.ptp(places, axis=0), 1e-12)
    weights = np.stack([1.0 - part, part], axis=-1)  # (N, 2, 2): axis, end
    mixed = np.einsum("ni,nj,ijc->nc", weights[:, 0], weights[:, 1], corners)
    return np.rint(mixed).astype(np.uint8)
