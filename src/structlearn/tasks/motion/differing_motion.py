"""What a model loses on motion that differs from its training motion, and which of its terms account for it.

If the test motion repeats the training motion, the stretch of the training motion that it repeats is halved:
a model is learned from the first half alone and tested on the second, which differs.

Torques of a motion that is repeated differ by what no model of positions, velocities and accelerations can
predict: this repeatability is the floor of the errors. Then one group of terms at a time is fitted to the
test motion itself by least squares, on top of the model: what the fit removes is what these terms lost.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques
from structlearn.rigid_body.friction import FRICTIONS, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, torque_regressor
from structlearn.rigid_body.tree import KinematicTree
from structlearn.tasks.motion.repeated_motion import REPEATED, difference

LEARNED, REPEATABILITY, ALL = "as learned", "repeatability", "all terms"
INERTIA = "inertia"
REFITTED = {"viscous and Coulomb friction": ("viscous", "coulomb"), "offset": ("offset",)}
REFITTED |= {"stiffness": ("stiffness",), INERTIA: ()}
"""Groups of terms that are fitted to the test motion, with the names of their friction terms."""


class DifferingMotion(NamedTuple):
    """A test motion that differs from the training motion."""

    train: Motion | None  # to learn from anew; None: the training motion
    test: Motion
    again: Motion | None  # repetition of `test`, sample by sample; None: nothing repeats it


def differing_motion(
    pieces: Mapping[str, Sequence[tuple[str, Motion]]], others: Sequence[Motion], shortest: int
) -> DifferingMotion | None:
    """Test motion that differs from the training motion, with its repetition, which may be one of `others`.

    `pieces`: pieces of motions, each with its log, by part: the training part, then the test part.
    `shortest`: number of samples. Returns None if the test motion repeats the training motion and no halves
    of it differ.
    """
    trained, tested = (pieces[part] for part in list(pieces)[:2])
    test = max((motion for _, motion in tested), key=len)
    for _, known in trained:
        if (places := repetition(known, test)) is not None:
            here, there = places
            return _halves(known.part(there), test.part(here), shortest)
    for known in others:
        if (places := repetition(known, test)) is not None:
            here, there = places
            return DifferingMotion(None, test.part(here), known.part(there))
    return DifferingMotion(None, test, None)


def _halves(train: Motion, again: Motion, shortest: int) -> DifferingMotion | None:
    """First and second half of a motion, halved further while both repeat each other."""
    half = len(train) // 2
    while half >= shortest:
        first, second = train.part(slice(half)), train.part(slice(half, 2 * half))
        if repetition(first, second) is None:
            return DifferingMotion(first, second, again.part(slice(half, 2 * half)))
        half //= 2
    return None


def repetition(known: Motion, test: Motion) -> tuple[slice, slice] | None:
    """Samples of a test motion, and those of a known motion that they repeat; None: it is not repeated."""
    squared, lag = difference(known.q, test.q)
    if not squared < REPEATED**2 * test.q.var(axis=0).sum():
        return None
    start, stop = max(0, -lag), min(len(test), len(known) - lag)
    return slice(start, stop), slice(start + lag, stop + lag)


def differing_errors(tree: KinematicTree, model: DynamicsModels, motion: DifferingMotion) -> pd.DataFrame:
    """Torque errors of the first of some models, of each fit to the test motion, and their floor.

    A fit minimises the sum over joints of squared errors relative to the model's own. The repeatability is
    the root mean square difference of the model's errors on both repetitions, over sqrt(2): since the model
    follows the small differences of their motions, the rest is what differs in the torques.

    Returns `joint` (from 1), `fitted` (`LEARNED`, a key of `REFITTED`, `ALL`, `REPEATABILITY`), `rmse_n_m`,
    `nmse` (relative to the variance of the test torque).
    """
    test, terms = motion.test, FRICTIONS["stiffness"]
    error = test.torque - predicted_torques(model, tree, test)[0]  # (N, n)
    links = torque_regressor(tree, test.q, test.qd, test.qdd)
    columns = np.concatenate([links, friction_regressor(test.q, test.qd, terms)], axis=-1)  # (N, n, P)
    count, last = test.joints, SYMMETRIC_COLUMNS * test.joints
    groups = {
        name: np.concatenate([last + len(terms) * np.arange(count) + terms.index(term) for term in its])
        for name, its in REFITTED.items()
        if its
    }
    groups |= {INERTIA: np.arange(last), ALL: np.arange(columns.shape[-1])}
    scale = 1.0 / np.sqrt(np.mean(error**2, axis=0))
    errors = {LEARNED: error}
    for name in (*REFITTED, ALL):
        chosen = columns[..., groups[name]]
        weighted = (chosen * scale[:, None]).reshape(-1, chosen.shape[-1])
        change = np.linalg.lstsq(weighted, (error * scale).ravel(), rcond=None)[0]
        errors[name] = error - chosen @ change
    if motion.again is not None:
        repeated = motion.again.torque - predicted_torques(model, tree, motion.again)[0]
        errors[REPEATABILITY] = (error - repeated) / np.sqrt(2.0)
    squares = {name: np.mean(values**2, axis=0) for name, values in errors.items()}
    tables = [
        pd.DataFrame({"joint": np.arange(1, count + 1), "fitted": name, "rmse_n_m": np.sqrt(square)}).assign(
            nmse=square / test.torque_variance
        )
        for name, square in squares.items()
    ]
    return pd.concat(tables, ignore_index=True)
