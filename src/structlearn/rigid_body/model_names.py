"""Keys and printed names of dynamics models, in the order of tables."""

from collections.abc import Iterable

IDEAL, ROBOT = "iiwa", "perturbed"
"""Arms: equal to its URDF, and robots that differ from their URDF (simulated, or logged by the user)."""

GROUND_TRUTH, DEFAULT = "ground_truth", "default"
"""Known models: that of the robot itself, and that of its URDF where it differs."""

COULOMB = "_coulomb"  # suffix of models that learned Coulomb friction beside viscous friction
STRICT = ("spd", "tri", "cov")  # positive definite inertia, which the dissertation finds best

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
"""Models without Coulomb friction."""


def model_name(model: str) -> str:
    """Printed name, e.g. `Cov` or `Cov + Coulomb`."""
    kind = model.removesuffix(COULOMB)
    return NAMES[kind] + (" + Coulomb" if model != kind else "")


def models_in_order(models: Iterable[str]) -> list[str]:
    """Models in the order of tables, each followed by its variant with Coulomb friction."""
    places = list(NAMES)
    return sorted(dict.fromkeys(models), key=lambda name: (places.index(name.removesuffix(COULOMB)), name))
