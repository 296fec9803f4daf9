"""Learned inertias beside the true ones, link by link and in what torques can tell apart."""

import numpy as np
import pandas as pd

from structlearn.rigid_body.base_parameters import BaseParameters
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

AXES = ("x", "y", "z")


def link_table(tree: KinematicTree, learned: LinkInertias, truth: LinkInertias) -> pd.DataFrame:
    """Masses, centres of mass and principal moments of inertia of M models.

    Args:
        tree: the robot.
        learned: mass (M, n).
        truth: mass (n,).

    Returns:
        Per model and link: `seed`, `link`, `mass_kg`, `centre_{x,y,z}_m`, `moment_{1,2,3}_kg_m2` in rising
        order, the same with the prefix `true_`, and whether such a body can exist: `positive_mass`,
        `positive_definite`, `triangle` (no moment above the sum of the others).
    """
    models = len(learned.mass)
    own, true = _columns(learned), _columns(truth)
    table = pd.DataFrame(
        {"seed": np.repeat(np.arange(models), len(tree.names)), "link": np.tile(tree.names, models)}
    )
    for name, values in own.items():
        table[name] = values.ravel()
    for name, values in true.items():
        table[f"true_{name}"] = np.tile(values, models)
    moments = [own[f"moment_{place}_kg_m2"].ravel() for place in (1, 2, 3)]
    table["positive_mass"] = table["mass_kg"] > 0.0
    table["positive_definite"] = moments[0] > 0.0
    table["triangle"] = moments[0] + moments[1] >= moments[2]
    return table


def base_table(
    tree: KinematicTree, base: BaseParameters, learned: LinkInertias, truth: LinkInertias
) -> pd.DataFrame:
    """Base parameters of M models: `seed`, `parameter`, `value`, `truth`, all in SI units."""
    values = base.values(learned)
    models = len(values)
    return pd.DataFrame(
        {
            "seed": np.repeat(np.arange(models), values.shape[1]),
            "parameter": np.tile(base.formulas(tree), models),
            "value": values.ravel(),
            "truth": np.tile(base.values(truth), models),
        }
    )


def _columns(inertias: LinkInertias) -> dict[str, np.ndarray]:
    """Columns (..., n) of one set of inertias; of a tensor that is not symmetric, its symmetric part."""
    centre = inertias.first_moment / inertias.mass[..., None]
    symmetric = 0.5 * (inertias.inertia + np.swapaxes(inertias.inertia, -1, -2))
    moments = np.linalg.eigvalsh(symmetric)
    columns = {"mass_kg": inertias.mass}
    columns |= {f"centre_{axis}_m": centre[..., place] for place, axis in enumerate(AXES)}
    return columns | {f"moment_{place + 1}_kg_m2": moments[..., place] for place in range(3)}
