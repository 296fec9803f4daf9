"""movement_primitives at the rows of `primitives`, in its fastest documented way.

`DMP` with the Cython step `euler-cython`, one Euler step per sample; its coupling term is then called once
per step, as ours. `imitate` takes one demonstration, so several are imitated one by one and their weights
averaged, which is what the joint regression gives for equal lengths. Orientation: the functions that
`CartesianDMP` calls for its orientation half; the class would do a position as well.

The transformation system is given the gains that make it our differential equation (its tau is the
duration, ours is twice that). Every public function builds a contender and raises ImportError when the
library is absent.
"""

from collections.abc import Callable, Sequence

import numpy as np
from primitive_inputs import AXES, DT, SAMPLES, CouplingNetwork, path_error, turn_error
from timing import Contender

from structlearn.primitives import transformation
from structlearn.primitives.canonical import TAU_PER_DURATION
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory

ALPHA = transformation.ALPHA / TAU_PER_DURATION
BETA = transformation.BETA / TAU_PER_DURATION


def fit(paths: Sequence[Trajectory], mean: np.ndarray) -> Contender:
    """Weights of one primitive from all demonstrations, whose mean is (T, D)."""
    dmp = _movement_primitive()

    def run() -> np.ndarray:
        weights = []
        for path in paths:
            dmp.imitate(path.time, path.position)
            weights.append(dmp.get_weights().copy())  # it is a view
        return np.mean(weights, axis=0)

    def error(weights: np.ndarray) -> float:
        dmp.set_weights(weights)
        dmp.configure(start_y=mean[0], goal_y=mean[-1])
        return path_error(dmp.open_loop(step_function="euler-cython")[1], mean)

    return Contender(run, error)


def unroll(paths: Sequence[Trajectory], reference: np.ndarray) -> Contender:
    """One unroll per demonstration, without feedback; reference (B, T, D)."""
    dmps = [_imitation(path) for path in paths]
    return Contender(
        lambda: [dmp.open_loop(step_function="euler-cython")[1] for dmp in dmps],
        lambda unrolled: path_error(np.stack(unrolled), reference),
    )


def coupled(path: Trajectory, network: CouplingNetwork, reference: np.ndarray) -> Contender:
    """Unroll with the network in the loop; reference (T, D)."""

    class Term:
        step = 0

        def coupling(self, y: np.ndarray, yd: np.ndarray) -> tuple[float, np.ndarray]:
            self.step += 1
            return 0.0, network(self.step - 1, y, yd) / TAU_PER_DURATION**2

    dmp = _imitation(path)
    return Contender(
        lambda: dmp.open_loop(coupling_term=Term(), step_function="euler-cython")[1],
        lambda unrolled: path_error(unrolled, reference),
    )


def coupled_idle(path: Trajectory) -> Contender:
    """Unroll with a coupling term that does nothing."""

    class Term:
        def coupling(self, y: np.ndarray, yd: np.ndarray) -> tuple[float, float]:
            return 0.0, 0.0

    dmp = _imitation(path)
    return Contender(
        lambda: dmp.open_loop(coupling_term=Term(), step_function="euler-cython")[1],
        lambda unrolled: path_error(unrolled, path.position),
    )


def quaternion_fit(path: OrientationTrajectory) -> Contender:
    """Weights of an orientation primitive from one demonstration."""
    arguments, unrolled = _orientation_primitive(path)

    def run() -> np.ndarray:
        from movement_primitives.dmp._cartesian_dmp import dmp_quaternion_imitation

        return dmp_quaternion_imitation(path.time, path.orientation, **arguments)[0]

    return Contender(run, lambda weights: turn_error(unrolled(weights), path.orientation))


def quaternion_unroll(path: OrientationTrajectory) -> Contender:
    """Unroll of an orientation primitive."""
    from movement_primitives.dmp._cartesian_dmp import dmp_quaternion_imitation

    arguments, unrolled = _orientation_primitive(path)
    weights = dmp_quaternion_imitation(path.time, path.orientation, **arguments)[0]
    return Contender(lambda: unrolled(weights), lambda turned: turn_error(turned, path.orientation))


def _imitation(path: Trajectory):
    """`DMP` that has imitated the demonstration."""
    dmp = _movement_primitive()
    dmp.imitate(path.time, path.position)
    return dmp


def _movement_primitive():
    """`DMP` of movement_primitives with our transformation system."""
    from movement_primitives.dmp import DMP

    return DMP(
        n_dims=AXES,
        execution_time=DT * (SAMPLES - 1),
        dt=DT,
        n_weights_per_dim=KERNEL_COUNT,
        int_dt=1.0,  # one step per sample: at int_dt = dt rounding would make a second, empty one
        alpha_y=ALPHA,
        beta_y=BETA,
    )


def _orientation_primitive(path: OrientationTrajectory) -> tuple[dict, Callable[[np.ndarray], np.ndarray]]:
    """Arguments of movement_primitives' quaternion imitation, and its unroll as a function of the weights."""
    from movement_primitives.dmp import CartesianDMP
    from movement_primitives.dmp._cartesian_dmp import dmp_open_loop_quaternion

    dmp = CartesianDMP(path.duration, DT, KERNEL_COUNT)
    term = dmp.forcing_term_rot
    gains = {"alpha_y": np.full(3, ALPHA), "beta_y": np.full(3, BETA)}
    arguments = {
        "n_weights_per_dim": KERNEL_COUNT,
        "regularization_coefficient": 0.0,
        "overlap": term.overlap,
        "alpha_z": term.alpha_z,
        "allow_final_velocity": False,
        **gains,
    }

    def unrolled(weights: np.ndarray) -> np.ndarray:
        term.weights_[...] = weights
        ends = {"start_y": path.orientation[0], "goal_y": path.orientation[-1]}
        return dmp_open_loop_quaternion(
            path.duration, 0.0, DT, **ends, **gains, forcing_term=term, int_dt=1.0
        )[1]

    return arguments, unrolled
