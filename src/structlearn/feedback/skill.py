"""What a robot is given: primitives, expected sensor traces and feedback models, as saved files hold them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from structlearn.feedback.pmnn import PhaseModulatedNetwork, read_networks
from structlearn.ground.errors import InputError
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.primitive_files import read_primitives, read_vector_primitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive

UNIT_TOLERANCE = 1e-6
"""How far the norm of an axis or a quaternion may be from 1."""


@dataclass(frozen=True)
class ReactiveSkill:
    """Primitives in sequence, with feedback where they have a network.

    Attributes:
        primitives: with orientations of the quaternion form, or all without orientation and networks.
        expected: expected sensor traces by the primitive's name, all of the same channels.
        networks: feedback models by the primitive's name; each takes all channels, or none (`open_loop`).
        axis: (3,) unit vector in the base frame, about which the networks correct the orientation.

    Raises:
        InputError: the parts do not fit together; the message names the primitive.
    """

    primitives: Sequence[PosePrimitive]
    expected: Mapping[str, VectorPrimitive] = field(default_factory=dict)
    networks: Mapping[str, PhaseModulatedNetwork] = field(default_factory=dict)
    axis: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))

    def __post_init__(self) -> None:
        names = [primitive.name for primitive in self.primitives]
        if not names:
            raise InputError("a skill needs at least one primitive")
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"two primitives are called '{name}'")
        for kind, parts in (("expected traces", self.expected), ("a network", self.networks)):
            for name in parts:
                if name not in names:
                    raise InputError(f"there are {kind} for '{name}', but no such primitive")
        require_unit(self.axis, 3, "the axis of the feedback")
        for primitive in self.primitives:
            _check_orientation(primitive, bool(self.networks))
        for name, traces in self.expected.items():
            if len(traces.start) != self.channels:
                raise InputError(
                    f"'{name}' has expected traces of {len(traces.start)} channels, others {self.channels}"
                )
        for name, network in self.networks.items():
            _check_network(name, network, self.expected.get(name))

    @property
    def channels(self) -> int:
        """Number of sensor channels, 0 without expected traces."""
        return next((len(traces.start) for traces in self.expected.values()), 0)

    def index(self, primitive: int | str) -> int:
        """Place of a primitive in the sequence, by its name or its place.

        Raises:
            InputError: there is no such primitive.
        """
        names = [part.name for part in self.primitives]
        if primitive in names:
            return names.index(primitive)
        if isinstance(primitive, str) or not 0 <= primitive < len(names):
            raise InputError(f"there is no primitive {primitive!r} among {', '.join(names)}")
        return primitive


def read_skill(
    primitives_file: str | Path,
    expected_folder: str | Path,
    networks_file: str | Path,
    axis: np.ndarray,
) -> ReactiveSkill:
    """Load a skill from the files that the pipeline writes.

    Args:
        primitives_file: of `primitives.primitive_files.write_primitives`.
        expected_folder: one file of `write_vector_primitive` per primitive, `<primitive>.safetensors`; those
            without a file have no expected traces.
        networks_file: of `pmnn.write_networks`, by the primitives' names.
        axis: (3,) unit vector in the base frame, about which the networks correct.

    Raises:
        InputError: a file is missing or of another kind, or the parts do not fit together.
    """
    folder = Path(expected_folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; run the stage that writes it")
    expected = {file.stem: read_vector_primitive(file) for file in sorted(folder.glob("*.safetensors"))}
    return ReactiveSkill(read_primitives(primitives_file), expected, read_networks(networks_file), axis)


def open_loop(weights: np.ndarray) -> PhaseModulatedNetwork:
    """A policy that needs no sensor: c = G(p, u) . weights, as a network without inputs.

    Args:
        weights: (N,) one per phase feature.
    """
    weights = np.asarray(weights, dtype=float)
    return PhaseModulatedNetwork(
        input_mean=np.empty(0),
        input_scale=np.empty(0),
        hidden=(),
        phase_weights=np.empty((len(weights), 0)),
        phase_biases=weights,
        output_weights=np.ones(len(weights)),
    )


def require_unit(values: np.ndarray, size: int, what: str) -> np.ndarray:
    """The values as a (size,) float array.

    Raises:
        InputError: another size, a value that is not finite, or a norm that is not 1.
    """
    array = require_finite(values, size, what)
    if abs(np.linalg.norm(array) - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{what} must have norm 1, has {np.linalg.norm(array):.6g}")
    return array


def require_finite(values: np.ndarray, size: int, what: str) -> np.ndarray:
    """The values as a (size,) float array; InputError for another size or a value that is not finite."""
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be {size} numbers, is {values!r}") from error
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{what} must be {size} finite numbers, is {array}")
    return array


def _check_orientation(primitive: PosePrimitive, feedback: bool) -> None:
    if primitive.orientation is None:
        if feedback:
            raise InputError(f"'{primitive.name}' has no orientation, which feedback would correct")
    elif not isinstance(primitive.orientation, QuaternionPrimitive):
        raise InputError(
            f"the orientation of '{primitive.name}' is a {type(primitive.orientation).__name__}: "
            "the controller steps quaternion primitives only, which turn less than half a circle"
        )


def _check_network(name: str, network: PhaseModulatedNetwork, expected: VectorPrimitive | None) -> None:
    inputs, *widths = network.sizes
    if inputs and expected is None:
        raise InputError(f"the network of '{name}' takes {inputs} channels, but there are no expected traces")
    if inputs and inputs != len(expected.start):
        raise InputError(
            f"the network of '{name}' takes {inputs} channels, but its expected traces have "
            f"{len(expected.start)}"
        )
    kernels = len(network.output_weights)
    if kernels < 2:
        raise InputError(f"the network of '{name}' has {kernels} phase kernels, needs about {KERNEL_COUNT}")
    shapes = [(weights.shape, (width,)) for (weights, _), width in zip(network.hidden, widths, strict=True)]
    shapes += [(network.phase_weights.shape, network.phase_biases.shape)]
    wanted = [
        ((width, before), (width,))
        for before, width in zip([inputs, *widths], [*widths, kernels], strict=True)
    ]
    if network.input_scale.shape != (inputs,) or shapes != wanted:
        raise InputError(f"the layers of the network of '{name}' do not fit together: {shapes}")
    arrays = [network.input_mean, network.input_scale, network.phase_weights, network.phase_biases]
    arrays += [network.output_weights, *(array for layer in network.hidden for array in layer)]
    if not all(np.isfinite(array).all() for array in arrays) or not (network.input_scale > 0).all():
        raise InputError(f"the network of '{name}' holds a value that is not finite or a scale of 0")
