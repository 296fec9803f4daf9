"""Combinations of inertial parameters that joint torques can tell apart (Gautier and Khalil 1990).

Of the ten parameters of each link some never act on a joint, and others act only in sums. A learned mass need
not be the link's mass, while the base parameters of a good model are those of the robot.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, link_parameters, torque_regressor
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

SYMBOLS = ("m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Of the columns of a link; inertias about the joint origin."""

_STATES = 200
_MOST_SAMPLES = 3000  # of a motion whose condition number is asked for: more would change its third digit
_DEPENDENT = 1e-4  # of a column; rounding leaves 1e-15, and URDFs write a right angle as 1.5708 rad
_NO_SHARE = 1e-9  # factors below are rounding
_NOT_WORTH_A_WORD = 1e-5  # factors below are not written


@dataclass(frozen=True)
class BaseParameters:
    """Identifiable combinations beta = combination @ theta.

    Attributes:
        columns: (r,) the parameter of theta that stands for each combination, with factor 1.
        combination: (r, 10 n) the factors.
    """

    columns: np.ndarray
    combination: np.ndarray

    def values(self, inertias: LinkInertias) -> np.ndarray:
        """Base parameters (..., r) of inertias with mass (..., n), in the SI units of their columns."""
        return link_parameters(inertias.tensors()).detach().numpy() @ self.combination.T

    def formulas(self, tree: KinematicTree) -> list[str]:
        """Each combination in words, e.g. `Ixx[joint_2] - Iyy[joint_2] + 0.176 m[joint_3]`."""
        return [
            _formula(row, column, tree.names)
            for row, column in zip(self.combination, self.columns, strict=True)
        ]


def base_parameters(tree: KinematicTree, seed: int = 0) -> BaseParameters:
    """Base parameters of a robot, found from its regressor at random states.

    Columns are taken from the base to the tip; one that depends on those before it is distributed among them,
    so that what belongs to a link is added to the links that carry it.

    Args:
        tree: n joints.
        seed: of the states, positions within the limits; the result does not depend on it.
    """
    q, qd, qdd = _random_states(tree, np.random.default_rng(seed))
    stacked = torque_regressor(tree, q, qd, qdd).reshape(q.size, -1)
    (triangle,) = qr(stacked, mode="r")  # the same dependencies in fewer rows
    columns = _independent(triangle[: stacked.shape[1]])
    combination = np.linalg.lstsq(triangle[:, columns], triangle, rcond=None)[0]
    combination[np.abs(combination) < _NO_SHARE] = 0.0
    return BaseParameters(columns, combination)


def condition_number(tree: KinematicTree, motion: Motion) -> float:
    """Condition number of the regressor of the base parameters over a motion, columns scaled to unit length.

    By so much errors of the torques may grow on their way to the parameters; below 100 counts as well
    excited.

    Args:
        tree: n joints.
        motion: of these joints, in the tree's order.

    Returns:
        At least 1; infinite where a parameter does not show at all, or there are fewer torques than
        parameters.
    """
    part = motion.part(np.unique(np.linspace(0, len(motion) - 1, _MOST_SAMPLES).round().astype(int)))
    columns = base_parameters(tree).columns
    stacked = torque_regressor(tree, part.q, part.qd, part.qdd).reshape(part.q.size, -1)[:, columns]
    lengths = np.linalg.norm(stacked, axis=0)
    if len(stacked) < len(columns) or not lengths.all():
        return float("inf")
    values = np.linalg.svd(stacked / lengths, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")


def _random_states(
    tree: KinematicTree, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    lower = np.where(np.isfinite(tree.lower), tree.lower, -np.pi)
    upper = np.where(np.isfinite(tree.upper), tree.upper, np.pi)
    q = generator.uniform(lower, upper, (_STATES, len(tree.names)))
    qd, qdd = generator.normal(0.0, (2.0, 10.0), (*q.shape, 2)).transpose(2, 0, 1)  # of like effect
    return q, qd, qdd


def _independent(triangle: np.ndarray) -> np.ndarray:
    """Indices of columns that do not depend on earlier ones, by Gram-Schmidt."""
    lengths = np.linalg.norm(triangle, axis=0)
    floor = _DEPENDENT * lengths.max()
    basis = np.zeros((len(triangle), 0))
    independent = []
    for index in np.flatnonzero(lengths > floor):
        rest = triangle[:, index] / lengths[index]
        for _ in range(2):  # twice is enough for an orthogonal rest
            rest = rest - basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > _DEPENDENT:
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            independent.append(index)
    return np.array(independent)


def _formula(row: np.ndarray, own: int, names: tuple[str, ...]) -> str:
    others = [column for column in np.flatnonzero(np.abs(row) > _NOT_WORTH_A_WORD).tolist() if column != own]
    text = _label(own, names)
    for column in others:
        sign, factor = ("-", "+")[int(row[column] > 0.0)], abs(row[column])
        share = "" if abs(factor - 1.0) < _NOT_WORTH_A_WORD else f"{factor:.4g} "
        text += f" {sign} {share}{_label(column, names)}"
    return text


def _label(column: int, names: tuple[str, ...]) -> str:
    link, entry = divmod(int(column), SYMMETRIC_COLUMNS)
    return f"{SYMBOLS[entry]}[{names[link]}]"
