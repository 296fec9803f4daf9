"""A planar arm of unknown lengths: identified with its kinematics, where there is no URDF.

Joints turn about the same horizontal axis. Torques are linear in the inertial parameters once it is known
where each joint stands on the link before it, so only these places are searched for, and least squares give
the rest (variable projection). Gravity is known, so lengths are in metres.
"""

import numpy as np

from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.identification import fit_structure, least_squares, normalised_triangle
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

GRAVITY = 9.81  # m/s^2, against y


def planar_tree(places: np.ndarray) -> KinematicTree:
    """Kinematics of n joints about z; `places` (n - 1, 2) m: x and y of joints 2 to n on the link before."""
    n = len(places) + 1
    translation = np.zeros((n, 3))
    translation[1:, :2] = places
    unlimited = np.full(n, np.inf)
    return KinematicTree(
        names=tuple(f"joint_{number}" for number in range(1, n + 1)),
        parents=np.arange(n) - 1,
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        translation=translation,
        axis=np.tile([0.0, 0.0, 1.0], (n, 1)),
        prismatic=np.zeros(n, dtype=bool),
        lower=-unlimited,
        upper=unlimited,
        velocity=unlimited,
        gravity=np.array([0.0, -GRAVITY, 0.0]),
    )


def fit_planar_arm(motion: Motion, iterations: int) -> tuple[KinematicTree, DynamicsModels]:
    """Places of the joints by least squares, then physically consistent inertias (cov) by L-BFGS.

    Every search begins with links of 1 m and 1 kg. Errors count as in `normalised_triangle`.
    """
    from scipy.optimize import minimize

    joints = motion.joints

    def triangle(places: np.ndarray) -> np.ndarray:
        tree = planar_tree(places.reshape(-1, 2))
        return normalised_triangle(MotionRegressor(tree, motion, True, ()).factors)

    def error(places: np.ndarray) -> float:
        its = triangle(places)
        return float(np.linalg.norm(its[:, :-1] @ least_squares(its) - its[:, -1]))

    start = np.tile([1.0, 0.0], joints - 1)
    places = minimize(error, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).x
    bodies = LinkInertias(
        np.ones(joints), np.tile([0.5, 0.0, 0.0], (joints, 1)), np.tile(0.1 * np.eye(3), (joints, 1, 1))
    )
    free, rubbing = fit_structure("cov", triangle(places), (), bodies, iterations)
    tree = planar_tree(places.reshape(-1, 2))
    return tree, DynamicsModels("cov", tree.names, (), (), {"inertia": free, "friction": rubbing})
