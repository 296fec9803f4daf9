"""Base parameters: combinations of inertial parameters identifiable from torques (Gautier and Khalil 1990).

Some of a link's ten inertial parameters never affect a joint torque, and others do so only in sums. A learned
mass therefore need not be the link's mass, but the base parameters of a good model match those of the robot.
How well a motion determines them is measured by the condition number of Gautier (1992).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.linalg import qr
from scipy.special import stdtrit

from structlearn.core.metrics import block_sums, blocks, drawn_counts
from structlearn.rigid_body.friction import FrictionTerm, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

SYMBOLS = ("m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Names of a link's columns; inertias are about the joint origin."""

_STATES = 200
_DEPENDENT = 1e-4  # share of a column's norm; rounding leaves 1e-15, but URDFs write a right angle as 1.5708
_SINGULAR = 1e-10  # eigenvalues below this share of the largest count as zero
_PIECES_PER_PARAMETER = 3  # least number of blocks times joints per parameter, for intervals
_NO_SHARE = 1e-9  # smaller factors are rounding errors
_NOT_WORTH_A_WORD = 1e-5  # smaller factors are left out of formulas


@dataclass(frozen=True)
class BaseParameters:
    """Identifiable combinations beta = combination @ theta."""

    columns: np.ndarray  # (r,) theta index of the parameter with factor 1 that names each combination
    combination: np.ndarray  # (r, 10 n) factors

    def values(self, inertias: LinkInertias) -> np.ndarray:
        """Base parameters (..., r) of link inertias, mass (..., n), in SI units."""
        return link_parameters(inertias.tensors()).detach().numpy() @ self.combination.T

    def formulas(self, tree: KinematicTree) -> list[str]:
        """Each combination as a formula, e.g. `Ixx[joint_2] - Iyy[joint_2] + 0.176 m[joint_3]`."""
        pairs = zip(self.combination, self.columns, strict=True)
        return [_formula(row, column, tree.names) for row, column in pairs]


def base_parameters(tree: KinematicTree) -> BaseParameters:
    """Base parameters of a robot, from the rank of its regressor at random states within the limits.

    Columns are processed from base to tip. A column that depends on earlier ones is distributed among them,
    so inertia of a link is added to the links that carry it. The result does not depend on the states drawn.
    """
    q, qd, qdd = _random_states(tree, np.random.default_rng(0))
    stacked = torque_regressor(tree, q, qd, qdd).reshape(q.size, -1)
    (triangle,) = qr(stacked, mode="r")  # the same linear dependencies in fewer rows
    columns = _independent(triangle[: stacked.shape[1]])
    combination = np.linalg.lstsq(triangle[:, columns], triangle, rcond=None)[0]
    combination[np.abs(combination) < _NO_SHARE] = 0.0
    return BaseParameters(columns, combination)


@dataclass(frozen=True)
class BaseFit:
    """Least-squares fit of base parameters and friction, with 95 % intervals.

    The condition number is the ratio of the largest to the smallest singular value, with columns scaled to
    unit length: a bound on the growth of relative errors. A motion below 100 counts as well excited.
    """

    condition: float
    parameters: np.ndarray  # (r,) base parameters, SI units
    low: np.ndarray  # (r,) lower and
    high: np.ndarray  # (r,) upper ends of their intervals


def fit_base(
    tree: KinematicTree,
    base: BaseParameters,
    motion: Motion,
    friction: tuple[FrictionTerm, ...],
    length: int,
    draws: int,
    seed: int,
) -> BaseFit:
    """Fit base parameters and friction to a motion, each joint's error weighted by 1 / its torque variance.

    The bootstrap resamples `draws` times blocks of `length` samples (shorter if there are too few blocks for
    the number of parameters). Intervals use the t distribution, because percentiles of so few blocks covered
    the truth in only 91 of 100 logs.
    """
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd)[..., base.columns]
    columns = np.concatenate([columns, friction_regressor(motion.q, motion.qd, friction)], axis=-1)
    least = -(-_PIECES_PER_PARAMETER * columns.shape[-1] // motion.joints)
    length = max(1, min(length, len(motion) // least))
    weight = 1.0 / np.sqrt(motion.torque_variance)[:, None]
    columns, torque = weight * columns, weight[:, 0] * motion.torque  # (N, n, r), (N, n)
    scale = np.sqrt(np.square(columns).sum(axis=(0, 1)))
    shows = scale > 0.0
    columns = columns / np.where(shows, scale, 1.0)
    squares = np.array([np.tensordot(block, block, ((0, 1), (0, 1))) for block in blocks(columns, length)])
    products = block_sums(np.einsum("njp,nj->np", columns, torque), length)
    counts = np.vstack([np.ones(len(squares)), drawn_counts(len(squares), draws, seed)])
    inverse = np.linalg.pinv(np.tensordot(counts, squares, 1), rcond=_SINGULAR, hermitian=True)
    drawn = np.einsum("dpq,dq->dp", inverse, counts @ products) / np.where(shows, scale, 1.0)
    singular = np.linalg.svd(columns.reshape(-1, columns.shape[-1]), compute_uv=False)
    condition = singular[0] / singular[-1] if singular[-1] > 0.0 else np.inf
    values, pieces = drawn[:, : len(base.columns)], len(squares) * motion.joints
    free = max(1, pieces - columns.shape[-1])  # degrees of freedom of the residuals
    half = stdtrit(max(1, len(squares) - 1), 0.975) * np.sqrt(pieces / free) * values[1:].std(axis=0)
    return BaseFit(float(condition), values[0], values[0] - half, values[0] + half)


def link_table(tree: KinematicTree, learned: LinkInertias, truth: LinkInertias) -> pd.DataFrame:
    """Masses, centres of mass and principal moments of M learned models, mass (M, n), and the truth (n,).

    Per model and link: `seed`, `link`, `mass_kg`, `centre_{x,y,z}_m`, `moment_{1,2,3}_kg_m2` (ascending), the
    same with prefix `true_`, and the conditions of physical consistency: `positive_mass`,
    `positive_definite`, `triangle` (no moment above the sum of the other two).
    """
    models = len(learned.mass)
    columns = {"seed": np.repeat(np.arange(models), len(tree.names)), "link": np.tile(tree.names, models)}
    columns |= {name: values.ravel() for name, values in _columns(learned).items()}
    columns |= {f"true_{name}": np.tile(values, models) for name, values in _columns(truth).items()}
    least, middle, largest = (columns[f"moment_{place}_kg_m2"] for place in (1, 2, 3))
    columns |= {"positive_mass": columns["mass_kg"] > 0.0, "positive_definite": least > 0.0}
    return pd.DataFrame(columns | {"triangle": least + middle >= largest})


def base_table(
    tree: KinematicTree, base: BaseParameters, learned: LinkInertias, truth: LinkInertias
) -> pd.DataFrame:
    """Base parameters of M models: `seed`, `parameter`, `value`, `truth`, all in SI units."""
    values = base.values(learned)
    models = len(values)
    columns = {"seed": np.repeat(np.arange(models), values.shape[1])}
    columns |= {"parameter": np.tile(base.formulas(tree), models), "value": values.ravel()}
    return pd.DataFrame(columns | {"truth": np.tile(base.values(truth), models)})


def _random_states(
    tree: KinematicTree, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q = generator.uniform(*tree.ranges, (_STATES, len(tree.names)))
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
        for _ in range(2):  # Gram-Schmidt needs a second pass for full orthogonality
            rest = rest - basis @ (basis.T @ rest)
        if np.linalg.norm(rest) > _DEPENDENT:
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            independent.append(index)
    return np.array(independent)


def _formula(row: np.ndarray, own: int, names: tuple[str, ...]) -> str:
    labels = [f"{symbol}[{name}]" for name in names for symbol in SYMBOLS]
    text = labels[own]
    for column in np.flatnonzero(np.abs(row) > _NOT_WORTH_A_WORD):
        if column != own:
            sign, factor = ("-", "+")[int(row[column] > 0.0)], abs(row[column])
            share = "" if abs(factor - 1.0) < _NOT_WORTH_A_WORD else f"{factor:.4g} "
            text += f" {sign} {share}{labels[column]}"
    return text


def _columns(inertias: LinkInertias) -> dict[str, np.ndarray]:
    """Table columns (..., n) of link inertias; a non-symmetric tensor counts by its symmetric part."""
    centre = inertias.first_moment / inertias.mass[..., None]
    symmetric = 0.5 * (inertias.inertia + np.swapaxes(inertias.inertia, -1, -2))
    moments = np.linalg.eigvalsh(symmetric)
    columns = {"mass_kg": inertias.mass}
    columns |= {f"centre_{axis}_m": centre[..., place] for place, axis in enumerate("xyz")}
    return columns | {f"moment_{place + 1}_kg_m2": moments[..., place] for place in range(3)}
