"""How far off estimated points of contact are; only a simulation knows the true ones."""

import numpy as np
import pandas as pd

from structlearn.tactile.electrodes import Skin
from structlearn.tactile.touch_dataset import TouchDataset

SQUARE_MM = 1.5
"""Side of the squares of skin in which errors are gathered."""


def contact_errors(dataset: TouchDataset, truth: pd.DataFrame, skin: Skin) -> pd.DataFrame:
    """Estimated against true contact points, of pressed samples.

    `dataset`: samples of touch, which number demonstrations in the order of `truth`; `truth`: see
    `simulation.touch_demonstrator.true_contacts`. Returns `error_mm`, the distance in space; `along_mm` and
    `across_mm`, its parts by surface coordinates, and where the true contact is, `true_along_mm` and
    `true_across_mm`.
    """
    names = {name: number for number, name in enumerate(truth["trial"].unique())}
    true = truth.assign(
        trial=truth["trial"].map(names), sample=_sample(truth["time_s"].to_numpy(), dataset)
    ).set_index(["trial", "sample"])[["x_m", "y_m", "z_m"]]
    kept = np.flatnonzero(dataset.pressed)
    keys = pd.MultiIndex.from_arrays([dataset.trial[kept], _sample(dataset.time[kept], dataset)])
    true = true.loc[keys].to_numpy(float)
    found = dataset.contact_point[kept].astype(float)
    places = [1e3 * np.stack(skin.coordinates(points)) for points in (found, true)]
    along, across = places[0] - places[1]
    return pd.DataFrame(
        {
            "error_mm": 1e3 * np.linalg.norm(found - true, axis=1),
            "along_mm": along,
            "across_mm": across,
            "true_along_mm": places[1][0],
            "true_across_mm": places[1][1],
        }
    )


def contact_bias(errors: pd.DataFrame) -> pd.DataFrame:
    """Mean errors over squares of skin.

    `errors`: of `contact_errors`. Returns middle of the true contacts' square, `square_along_mm`,
    `square_across_mm`; means of `along_mm`, `across_mm` and `error_mm`; `samples`; `squared_mm2`, their part
    in the sum of squared errors along and across that is the same for all of a square.
    """
    squares = [
        (SQUARE_MM * (np.floor(errors[f"true_{name}_mm"] / SQUARE_MM) + 0.5)).rename(f"square_{name}_mm")
        for name in ("along", "across")
    ]
    groups = errors[["along_mm", "across_mm", "error_mm"]].groupby(squares)
    means = groups.mean().assign(samples=groups.size())
    squared = means["samples"] * (means["along_mm"] ** 2 + means["across_mm"] ** 2)
    return means.assign(squared_mm2=squared).reset_index()


def _sample(time: np.ndarray, dataset: TouchDataset) -> np.ndarray:
    return np.rint(time * float(dataset.rate_hz)).astype(int)
