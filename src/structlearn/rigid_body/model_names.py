"""Names of dynamics models for people, in the order of tables."""

from collections.abc import Iterable

IDEAL, ROBOT = "iiwa", "stand_in"
"""Arms: as its URDF has it, and robots, of which that knows little: simulated ones, or a log of your own."""

GROUND_TRUTH, DEFAULT = "ground_truth", "default"
"""Models that are known instead of learned: of the robot itself, and of its URDF where that is another."""

COULOMB = "_coulomb"
"""Suffix of models that learned Coulomb friction beside viscous friction."""

STRICT = ("spd", "tri", "cov")
"""Structures with a positive definite inertia: those that the dissertation finds best."""

NAMES = {
    GROUND_TRUTH: "ground truth",
    DEFAULT: "default (URDF)",
    "mlp": "MLP",
    "mlp_scaled": "MLP, scaled",
    "delan": "DeLaN",
    "nostr": "NoStr",
    "symm": "Symm",
    "spd": "SPD",
    "tri": "Tri",
    "cov": "Cov",
}
"""Of the models without Coulomb friction."""


def model_name(model: str) -> str:
    """`Cov` or `Cov + Coulomb`."""
    kind = model.removesuffix(COULOMB)
    return NAMES[kind] + (" + Coulomb" if model != kind else "")


def in_order(models: Iterable[str]) -> list[str]:
    """Names of models in the order of tables, each with its variant with Coulomb friction behind it."""
    places = list(NAMES)
    return sorted(dict.fromkeys(models), key=lambda name: (places.index(name.removesuffix(COULOMB)), name))
