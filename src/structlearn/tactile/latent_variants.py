"""Names of what is compared: latent spaces with and without structure, forward and inverse models."""

from typing import Final, Literal

STRUCTURES = (True, False)
"""Whether the latent space has structure: L_MDS and L_CDP in its loss."""

InverseModel = Literal["LL", "NG", "NJ"]

LOCALLY_LINEAR: InverseModel = "LL"
NEGATIVE_GRADIENT: InverseModel = "NG"
JACOBIAN: InverseModel = "NJ"
"""Names of the inverse models."""

NONLINEAR = "NL"
"""Name of the other forward model, beside `LOCALLY_LINEAR`."""

UNCHANGED = "unchanged"
"""The prediction that nothing moves, beside the forward models."""

NO_INVERSE: Final = "none"
"""Trained with L_LFD alone."""

TRAINED_WITH: dict[str, tuple[InverseModel | Literal["none"], ...]] = {
    LOCALLY_LINEAR: (NO_INVERSE, LOCALLY_LINEAR),
    NONLINEAR: (NO_INVERSE, NEGATIVE_GRADIENT, JACOBIAN),
}
"""Per forward model, the inverse models whose loss L_ID it is trained with, in the order of its stack."""

FORWARD_OF: dict[InverseModel, str] = {
    LOCALLY_LINEAR: LOCALLY_LINEAR,
    NEGATIVE_GRADIENT: NONLINEAR,
    JACOBIAN: NONLINEAR,
}
"""Per inverse model, the forward model that it shares its parameters with."""
