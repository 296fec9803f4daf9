"""Fits and unrolls of movement primitives, beside movement_primitives, mp_pytorch and pydmps.

How the peers do the work is in `peer_movement_primitives`, `peer_mp_pytorch` and `peer_pydmps`. All keep
their own kernels and clock, so results are compared as paths: fits must reproduce the demonstrations' mean,
unrolls the demonstrations, and the coupled unroll a converged one. Numerical derivatives, Euler steps, single
precision and local regression cost the peers accuracy, up to one and a half percent here, which is allowed.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import peer_movement_primitives
import peer_mp_pytorch
import peer_pydmps
from primitive_inputs import (
    AXES,
    COUPLING_SCALE,
    DT,
    NETWORK,
    SAMPLES,
    STROKES,
    CouplingNetwork,
    demonstrations,
    orientation_demonstration,
    path_error,
    stroke_demonstrations,
    turn_error,
)
from timing import Case, Contender

from structlearn.core.compilation import call
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.primitives import canonical, kernels, trajectory, transformation
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.orientation import QuaternionPrimitive, fit_quaternion
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.twist_swing import fit_twist_swing
from structlearn.primitives.vector import VectorPrimitive, fit_rhythmic, fit_vector

DEMONSTRATIONS, BATCH, JOINTS = 11, 38, 7
CUTOFF_HZ = 25.0


def fit_from_positions(count: int) -> Case:
    """Weights of one primitive from the positions of so many demonstrations, with all that comes before."""
    paths = demonstrations(count)
    mean = np.mean([path.position for path in paths], axis=0)

    def run() -> VectorPrimitive:
        kernels.shared_features.clear()
        return fit_vector([trajectory.differentiated(path.position, DT, CUTOFF_HZ) for path in paths])

    alone = {"pydmps": partial(peer_pydmps.fit, mean)} if count == 1 else {}
    return Case(
        work=f"fit {count} x {SAMPLES} x {AXES}, {KERNEL_COUNT} kernels, from positions",
        ours=Contender(run, lambda p: path_error(p.unroll(DT).position, mean)),
        peers={
            "movement_primitives": partial(peer_movement_primitives.fit, paths, mean),
            "mp_pytorch ProDMP": partial(peer_mp_pytorch.fit, paths, mean),
            **alone,
        },
        note="all begin with positions; ours with its low-pass, derivatives and features of this length; "
        "movement_primitives and pydmps differentiate without a low-pass, ProDMP needs no derivatives; "
        f"pydmps has {peer_pydmps.KERNELS} kernels, since it fits each alone",
    )


def fit(count: int, aim_ms: float | None) -> Case:
    """The same from trajectories that have their derivatives, which no peer takes."""
    paths = demonstrations(count)
    mean = np.mean([path.position for path in paths], axis=0)
    return Case(
        work=f"  {count}, derivatives and features known",
        ours=Contender(lambda: fit_vector(paths), lambda p: path_error(p.unroll(DT).position, mean)),
        aim_ms=aim_ms,
        note="as in cross-validation, where the same demonstrations are fitted again and again",
    )


def fit_lengths() -> Case:
    """Demonstrations of eleven lengths, none of them seen before."""
    lengths = [SAMPLES + 10 * (i - DEMONSTRATIONS // 2) for i in range(DEMONSTRATIONS)]
    paths = demonstrations(DEMONSTRATIONS, lengths)
    fractions = np.linspace(0.0, 1.0, SAMPLES)
    mean = np.mean(
        [path.position[np.rint(fractions * (len(path.time) - 1)).astype(int)] for path in paths], 0
    )

    def run() -> VectorPrimitive:
        kernels.shared_features.clear()
        return fit_vector(paths)

    return Case(
        work="  of eleven different new lengths",
        ours=Contender(run, lambda p: path_error(p.unroll(DT).position, mean)),
    )


def unroll(batch: int, aim_ms: float) -> Case:
    """Movements of different weights with common start and goal, no feedback."""
    paths = demonstrations(batch)
    primitive = _fitted_batch(paths)
    reference = np.stack([path.position for path in paths])
    alone = {"pydmps": partial(peer_pydmps.unroll, reference[0])} if batch == 1 else {}
    return Case(
        work=f"unroll {batch} x {SAMPLES} x {AXES}",
        ours=Contender(lambda: primitive.unroll(DT), lambda path: path_error(path.position, reference)),
        peers={
            "movement_primitives": partial(peer_movement_primitives.unroll, paths, reference),
            "mp_pytorch DMP": partial(peer_mp_pytorch.unroll, paths, reference, "dmp"),
            "mp_pytorch ProDMP": partial(peer_mp_pytorch.unroll, paths, reference, "prodmp"),
            **alone,
        },
        aim_ms=aim_ms,
        note="from the weights, so with the forcing term; ours and pydmps return positions, velocities, "
        "accelerations, mp_pytorch no accelerations, movement_primitives positions only",
    )


def fit_joints() -> Case:
    """A primitive of seven joints, as of a pose but without a frame."""
    paths = [_of_joints(path) for path in demonstrations(DEMONSTRATIONS)]
    mean = np.mean([path.position for path in paths], axis=0)
    return Case(
        work=f"fit {DEMONSTRATIONS} x {SAMPLES} x {JOINTS} joints, derivatives and features known",
        ours=Contender(
            lambda: fit_position(paths, frame="none"), lambda p: path_error(p.unroll(DT).position, mean)
        ),
    )


def unroll_joints() -> Case:
    """Its unroll."""
    path = _of_joints(demonstrations(1)[0])
    primitive = fit_position([path], frame="none")
    return Case(
        work=f"unroll 1 x {SAMPLES} x {JOINTS} joints",
        ours=Contender(
            lambda: primitive.unroll(DT), lambda unrolled: path_error(unrolled.position, path.position)
        ),
    )


def _of_joints(path: Trajectory) -> Trajectory:
    """The axes of a path, mixed to as many as an arm has joints."""
    return path.turned(np.random.default_rng(JOINTS).normal(size=(AXES, JOINTS)))


def unroll_new_duration() -> Case:
    """An unroll whose step matrix is not known from before."""
    (path,) = demonstrations(1)
    primitive = _fitted_batch([path])

    def run() -> Trajectory:
        transformation.step_matrix.cache_clear()
        kernels.shared_features.clear()
        return primitive.unroll(DT)

    return Case(
        work="  of a duration not seen before",
        ours=Contender(run, lambda unrolled: path_error(unrolled.position, path.position)),
    )


def coupled(batch: int, aim_ms: float | None) -> Case:
    """Movements with a network in the loop, evaluated by numpy once per step."""
    paths = demonstrations(batch)
    primitive = _fitted_batch(paths)
    shape = (batch,) if batch > 1 else ()
    network = CouplingNetwork(shape)
    fine = 8
    reference = primitive.unroll(DT / fine, coupling=CouplingNetwork(shape, fine), until=DT * (SAMPLES - 1))
    reference = reference.position[..., ::fine, :]
    bend = path_error(reference, np.squeeze(np.stack([path.position for path in paths])))
    if not bend > 0.05:
        raise ValueError(f"the coupling bends the path by {bend:.2g} only, which checks nothing")
    peer = partial(peer_movement_primitives.coupled, paths[0], network, reference)
    size = "-".join(map(str, NETWORK))
    return Case(
        work=f"unroll {batch} x {SAMPLES} x {AXES} with a {size} network",
        ours=Contender(
            lambda: primitive.unroll(DT, coupling=network), lambda path: path_error(path.position, reference)
        ),
        peers={"movement_primitives": peer} if batch == 1 else {},
        aim_ms=aim_ms,
        note="the network is a Python callback of numpy products, the same object for both",
    )


class CompiledNetwork(CouplingNetwork):
    """The same network as the controller's compiled one, in which the modulated layer is linear."""

    def __init__(self) -> None:
        super().__init__(())
        inputs, kernel_count = NETWORK[0], NETWORK[-2]
        network = PhaseModulatedNetwork(
            input_mean=np.zeros(inputs),
            input_scale=np.ones(inputs),
            hidden=tuple(
                (weights.T, biases) for weights, biases in zip(self.weights, self.biases, strict=False)
            ),
            phase_weights=np.eye(kernel_count),
            phase_biases=np.zeros(kernel_count),
            output_weights=COUPLING_SCALE * self.weights[-1][:, 0],
        )
        times = np.linspace(0.0, 1.0, SAMPLES)
        self.rows = network.time_features(*canonical.phase(times, canonical.TAU_PER_DURATION))
        compiled = network.compiled()
        self.arguments, self.memory = compiled[:2], np.zeros(compiled.memory)
        self.kernel = network.kernel.address

    def __call__(self, step: int, x: np.ndarray, xd: np.ndarray) -> float:
        """Coupling term, the same on all axes, at x (3,) and xd (3,)."""
        self.inputs[:3] = x
        self.inputs[3:6] = xd
        return call(self.kernel, *self.arguments, self.rows[step], self.inputs, self.memory)


def coupled_compiled() -> Case:
    """The same movement with the same network, compiled."""
    primitive = _fitted_batch(demonstrations(1))
    network = CompiledNetwork()
    reference = primitive.unroll(DT, coupling=CouplingNetwork(())).position
    return Case(
        work="  with that network compiled",
        ours=Contender(
            lambda: primitive.unroll(DT, coupling=network), lambda path: path_error(path.position, reference)
        ),
        aim_ms=5.0,
        tolerance=1e-9,
        note="by the kernel of `feedback.models.pmnn`; only its rounding differs from the numpy network",
    )


def coupled_idle() -> Case:
    """What the loop costs beside the coupling term."""
    (path,) = demonstrations(1)
    primitive = _fitted_batch([path])
    return Case(
        work="  with a term that does nothing",
        ours=Contender(
            lambda: primitive.unroll(DT, coupling=lambda step, x, xd: 0.0),
            lambda unrolled: path_error(unrolled.position, path.position),
        ),
        peers={"movement_primitives": partial(peer_movement_primitives.coupled_idle, path)},
    )


def quaternion_fit_from_orientations() -> Case:
    """Weights of a quaternion primitive from the orientations of one demonstration."""
    path = orientation_demonstration(1.0)

    def run() -> QuaternionPrimitive:
        kernels.shared_features.clear()
        return fit_quaternion([trajectory.differentiated_orientation(path.orientation, DT, CUTOFF_HZ)])

    return Case(
        work=f"quaternion fit {SAMPLES}, from orientations",
        ours=Contender(run, lambda p: turn_error(p.unroll(DT).orientation, path.orientation)),
        peers={"movement_primitives": partial(peer_movement_primitives.quaternion_fit, path)},
        note="`off by` is an angle in rad; ours with its low-pass, derivatives and features of this length",
    )


def quaternion_fit() -> Case:
    """The same from a trajectory that has its derivatives."""
    path = orientation_demonstration(1.0)
    return Case(
        work="  derivatives and features known",
        ours=Contender(
            lambda: fit_quaternion([path]), lambda p: turn_error(p.unroll(DT).orientation, path.orientation)
        ),
        aim_ms=4.0,
    )


def quaternion_unroll() -> Case:
    """Unroll of a quaternion primitive."""
    path = orientation_demonstration(1.0)
    primitive = fit_quaternion([path])
    return Case(
        work=f"quaternion unroll {SAMPLES}",
        ours=Contender(
            lambda: primitive.unroll(DT), lambda turned: turn_error(turned.orientation, path.orientation)
        ),
        peers={"movement_primitives": partial(peer_movement_primitives.quaternion_unroll, path)},
        aim_ms=1.0,
        note="ours returns angular velocities and accelerations too",
    )


def twist_swing_unroll() -> Case:
    """Unroll of two and a half turns, which no peer has."""
    path = orientation_demonstration(5.0 * np.pi)
    primitive = fit_twist_swing([path])
    return Case(
        work=f"twist-swing unroll {SAMPLES}",
        ours=Contender(
            lambda: primitive.unroll(DT), lambda turned: turn_error(turned.orientation, path.orientation)
        ),
        tolerance=0.05,  # of 15.7 rad
        note="two and a half turns; angular velocities and accelerations included",
    )


def rhythmic_fit() -> Case:
    """Weights of a rhythmic primitive from demonstrations with different numbers of strokes."""
    paths, rhythms = stroke_demonstrations()
    return Case(
        work=f"rhythmic fit {len(paths)} x {SAMPLES} x {AXES}",
        ours=Contender(lambda: fit_rhythmic(paths, rhythms), _stroke_error),
        note=f"{', '.join(map(str, STROKES))} strokes; with the features of each demonstration",
    )


def rhythmic_unroll() -> Case:
    """Unroll of a rhythmic primitive."""
    primitive = fit_rhythmic(*stroke_demonstrations())
    return Case(
        work=f"rhythmic unroll {SAMPLES} x {AXES}",
        ours=Contender(lambda: primitive.unroll(DT), lambda _: _stroke_error(primitive)),
        note="with its features, which other lengths do not share",
    )


def _stroke_error(primitive: VectorPrimitive) -> float:
    """Error of the movement with the median number of strokes, which takes as long as all."""
    paths, rhythms = stroke_demonstrations()
    median = paths[1]
    repeated = primitive.repeated(rhythms[1].cycles)
    return path_error(repeated.unroll(DT, duration=median.duration).position, median.position)


def _fitted_batch(paths: Sequence[Trajectory]) -> VectorPrimitive:
    """Primitive with one set of weights per demonstration; start and goal are common to all."""
    weights = np.stack([fit_vector([path]).weights for path in paths])
    return replace(fit_vector(paths), weights=weights if len(paths) > 1 else weights[0])


CASES: tuple[Callable[[], Case], ...] = (
    lambda: fit_from_positions(1),
    lambda: fit(1, None),
    lambda: fit_from_positions(DEMONSTRATIONS),
    lambda: fit(DEMONSTRATIONS, 1.5),
    fit_lengths,
    lambda: unroll(1, 0.3),
    unroll_new_duration,
    fit_joints,
    unroll_joints,
    lambda: unroll(BATCH, 3.0),
    lambda: coupled(1, None),
    coupled_compiled,
    coupled_idle,
    lambda: coupled(BATCH, None),
    quaternion_fit_from_orientations,
    quaternion_fit,
    quaternion_unroll,
    twist_swing_unroll,
    rhythmic_fit,
    rhythmic_unroll,
)
