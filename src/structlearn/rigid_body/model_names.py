"""Keys and printed names of dynamics models, in the order of tables."""

from collections.abc import Iterable

IDEAL, ROBOT = "iiwa", "perturbed"
"""Arms: as in its URDF, and robots that differ from their URDF: simulated, or logged by the user."""

GROUND_TRUTH, DEFAULT = "ground_truth", "default"
"""Models that are known instead of learned: of the robot itself, and of its URDF where that differs."""

COULOMB = "_coulomb"  # suffix of models that learned Coulomb friction beside viscous friction
STRICT = ("spd", "tri", "cov")  # with a positive definite inertia, which the dissertation finds best

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
