"""Names, order and colours of the controllers and models that the page and the recordings show."""

from dissertation.servoing.protocol.servo_variants import ADAPTIVE, PUBLISHED, SPACES, ServoVariant
from structlearn import palette
from structlearn.palette import BLACK, BLUE, GREEN, GREY, LIGHT_BLUE, LIGHT_GREY, OCHRE, ORANGE, PINK
from structlearn.tactile.latent_parameters import (
    JACOBIAN,
    LOCALLY_LINEAR,
    NEGATIVE_GRADIENT,
    NO_INVERSE,
    TRAINED_WITH,
    UNCHANGED,
    InverseModel,
)

INVERSE_COLOURS: dict[InverseModel, str] = {LOCALLY_LINEAR: OCHRE, NEGATIVE_GRADIENT: PINK, JACOBIAN: BLUE}
"""Inverse models, in the order of the text."""

FORM_NAMES = {PUBLISHED: "published controller", ADAPTIVE: "adaptive controller"}
FORM_COLOURS = {PUBLISHED: palette.PUBLISHED, ADAPTIVE: palette.OURS}
AS_PUBLISHED, OURS = ServoVariant(PUBLISHED, JACOBIAN), ServoVariant(ADAPTIVE, JACOBIAN)
"""The dissertation's controller and the adaptive controller, both with the non-linear model's Jacobian."""

SPACE_COLOURS = dict(zip(SPACES.values(), (BLACK, GREY), strict=True))

DYNAMICS = tuple((forward, loss) for forward, losses in TRAINED_WITH.items() for loss in losses)
"""Forward models, each with the inverse model whose loss it was trained with."""

STILL = (UNCHANGED, NO_INVERSE)  # baseline: the latent state does not change

LATENT_NAMES = {
    "reconstruction": "reconstruction",
    "worst_electrode": "worst electrode",
    "distances": "map distances",
    "pressure": "pressure",
}
"""Latent-space errors."""

LATENT_COLOURS = {"reconstruction": BLUE, "distances": OCHRE, "pressure": PINK}

TARGET_NAMES = {
    "predicted": "what is predicted",
    "followed": "what followed",
    "agreement": "one against the other",
}
"""Latent states that an action is to reach, in the order of figure II.5."""

PART_NAMES = {"translation": "linear", "rotation": "angular"}  # parts of an action
SKIN_NAMES = {"biotac": "BioTac", "flat_pad": "flat pad", "sphere": "sphere"}

ESTIMATED, TRUE, LATENT = PINK, palette.GOOD, LIGHT_BLUE
"""Colours of the estimated contact, the true one, and the latent state."""

ELECTRODE_COLOURS = (LIGHT_BLUE, OCHRE, GREEN, PINK, ORANGE, BLUE, LIGHT_GREY)
"""Electrode colours, cycled by number so that consecutive numbers differ."""


def electrode_colours(count: int) -> list[str]:
    """Colours of electrodes 1 to `count`, in order."""
    return [ELECTRODE_COLOURS[number % len(ELECTRODE_COLOURS)] for number in range(count)]


def dynamics_name(forward: str, trained_with: str) -> str:
    """Name of a forward model, `NL` or, if trained with an inverse model's loss, `NL with NJ's loss`."""
    if forward == UNCHANGED:
        return "nothing moves"
    return forward if trained_with == NO_INVERSE else f"{forward} with {trained_with}'s loss"
