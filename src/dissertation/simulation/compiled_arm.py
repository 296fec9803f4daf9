"""Compiled time step of any arm: semi-implicit Euler, with Coulomb friction solved implicitly.

Coulomb friction as an explicit torque would make light wrist joints chatter at practical step sizes. So the
velocities v after a step and the friction impulses f are solved together (the same problem as Bullet's motors
that hold zero velocity with bounded torque, which Bullet solves by iteration):

    M (v - qd) = dt (tau - b) + f        |f_i| <= dt c_i        f_i = -dt c_i sign(v_i) where v_i is not 0

Which joints slide, and in which direction, is guessed from their velocities before the step. The guess is
corrected joint by joint, always at the first joint that contradicts it: M is positive definite, so the
solution is unique and this terminates there (Murty 1974). Usually the guess is right, and a step costs one
Cholesky factorisation.
"""

import numpy as np

from dissertation.simulation.compiled_chain import ChainState, factorise, solve
from structlearn.core.compilation import compiled_inside, numba

TIE = 1e-9
"""Relative excess of force at which a held joint starts to slide, so that rounding cannot cause cycles."""


@numba.njit(cache=True)
def step_arm(
    coulomb: np.ndarray, torques: np.ndarray, dt: float, work: ChainState, q: np.ndarray, qd: np.ndarray
) -> None:
    """Advance q and qd (n,) by dt, in place; a joint held by friction has exactly zero velocity.

    `coulomb` (n,) N m of friction; `torques` (n,) N m without it; `work`: of `compiled_chain.dynamics` at q
    and qd; of its mass matrix the lower triangle is used.
    """
    count, mass = len(q), work.mass_matrix
    impulse, slides, change = np.empty(count), np.empty(count), np.empty(count)
    matrix = np.empty((count, count))
    for i in range(count):
        impulse[i] = dt * (torques[i] - work.bias[i])
        slides[i] = np.sign(qd[i])
    wrong = True
    while wrong:
        _slide(coulomb, dt, impulse, slides, qd, mass, matrix, change)
        wrong = False
        for i in range(count):  # correct the guess at the first joint that contradicts it
            if coulomb[i] == 0.0:
                continue
            if slides[i] != 0.0:
                if slides[i] * (qd[i] + change[i]) < 0.0:
                    slides[i] = 0.0
                    wrong = True
                    break
            else:
                needed = -impulse[i]
                for j in range(count):
                    needed += mass[max(i, j), min(i, j)] * change[j]
                if abs(needed) > dt * coulomb[i] * (1.0 + TIE):
                    slides[i] = -np.sign(needed)
                    wrong = True
                    break
    for i in range(count):
        qd[i] = qd[i] + change[i]
        q[i] += dt * qd[i]


@numba.njit(cache=True, inline="always")
def _held(coulomb: np.ndarray, slides: np.ndarray, i: int) -> bool:
    return coulomb[i] > 0.0 and slides[i] == 0.0


@compiled_inside
def _slide(
    coulomb: np.ndarray,
    dt: float,
    impulse: np.ndarray,
    slides: np.ndarray,
    qd: np.ndarray,
    mass: np.ndarray,
    matrix: np.ndarray,
    change: np.ndarray,
) -> None:
    """Compute velocity changes (n,) for joints that slide (-1, 1) or are held (0) as guessed."""
    count = len(qd)
    for i in range(count):
        if _held(coulomb, slides, i):
            change[i] = -qd[i]
        else:
            change[i] = impulse[i] - dt * coulomb[i] * slides[i]
    for i in range(count):
        held = _held(coulomb, slides, i)
        for j in range(i + 1):
            other = _held(coulomb, slides, j)
            matrix[j, i] = mass[i, j]
            if held != other:  # held velocities are known: move them to the right-hand side
                matrix[j, i] = 0.0
                if held:
                    change[j] -= mass[i, j] * change[i]
                else:
                    change[i] -= mass[i, j] * change[j]
            elif held:
                matrix[j, i] = 1.0 if i == j else 0.0
    factorise(matrix)
    solve(matrix, change)
