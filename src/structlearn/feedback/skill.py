"""Skill for a robot: primitives, expected sensor traces, feedback models, and their bounds.

Each dimension of a coupling term has its own network of the same sensors (IV.6.2.3.2):
`networks["scrape"]["ry"]` corrects about the base frame's y axis while `scrape` runs.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.feedback.coupling import AXES, Axis, turns
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.transformation import ALPHA, BETA
from structlearn.primitives.vector import VectorPrimitive

TARGET_MARGIN = 1.5  # bound of a coupling term, relative to the largest demonstrated one
LARGEST_TURN, LARGEST_SHIFT = 40.0, ALPHA * BETA * 0.03
"""Default bounds in rad and m; a constant coupling at the bound turns by 15 degrees or shifts by 3 cm."""

CouplingBound = Annotated[float, Field(gt=0, le=1e4)]  # a constant coupling of 1e4 would shift by 64 m


class FadingParameters(Parameters):
    """Time constants of fading feedback. Fields: `params.yaml`, `write_skill`.

    `fade_s` bounds |dc/dt| within a primitive. At a switch c is set to 0, and the evolving goal absorbs the
    change (eq. IV.14), so that the acceleration stays continuous.
    """

    fade_s: float = Field(gt=0, le=60)
    stale_after_s: float = Field(gt=0, le=60)
    offset_within_s: float = Field(gt=0, le=60)


class Limits(FadingParameters):
    """Bounds on feedback, with cautious defaults."""

    # bound of |c| by axis, m or rad; a constant c shifts or turns by c / (ALPHA BETA). `largest_coupling`
    # derives it from demonstrated coupling terms.
    largest_coupling: dict[Axis, CouplingBound] = Field(
        default_factory=lambda: {axis: LARGEST_TURN if turns(axis) else LARGEST_SHIFT for axis in AXES}
    )
    fade_s: float = Field(default=0.05, gt=0, le=60)
    stale_after_s: float = Field(default=0.05, gt=0, le=60)
    offset_within_s: float = Field(default=0.1, gt=0, le=60)

    def of(self, axes: Sequence[Axis], dt: float) -> np.ndarray:
        """Bounds of coupling terms, and of their changes in a tick of dt s: (2, D).

        Raises InputError: an axis has no bound.
        """
        for axis in axes:
            if axis not in self.largest_coupling:
                raise InputError(f"the limits say no largest coupling term for {axis}")
        largest = np.array([self.largest_coupling[axis] for axis in axes], dtype=float)
        return np.stack([largest, largest * dt / self.fade_s])


def largest_coupling(targets: Sequence[np.ndarray]) -> float:
    """Bound of an axis's coupling term: `TARGET_MARGIN` times the largest demonstrated one."""
    return TARGET_MARGIN * max(float(np.abs(target).max()) for target in targets)


def demonstrated_limits(targets: Mapping[Axis, Sequence[np.ndarray]], fading: FadingParameters) -> Limits:
    """Limits from the coupling terms demonstrated on each axis; axes without demonstrations have none."""
    largest = {axis: largest_coupling(terms) for axis, terms in targets.items() if terms}
    return Limits(largest_coupling=largest, **fading.model_dump(include=set(FadingParameters.model_fields)))


Networks = Mapping[str, Mapping[Axis, CouplingModel]]
"""Feedback models by primitive, by axis; others are not corrected."""


@dataclass(frozen=True)
class Workspace:
    """A box along the axes of the base frame, or of joints.

    Raises InputError: the corners are not finite points, or in the wrong order.
    """

    low: np.ndarray  # (3,) m; of joints (J,)
    high: np.ndarray  # (3,) m; of joints (J,)
    joints: tuple[str, ...] = ()  # (J,) names

    def __post_init__(self) -> None:
        rule, shape = "a workspace needs a low and a high corner", (len(self.joints) or 3,)
        low, high = (real_numbers(corner, shape, rule) for corner in (self.low, self.high))
        if not (np.isfinite([low, high]).all() and (low < high).all()):
            raise InputError(f"{rule}, has {self.low} and {self.high}")

    def require(self, point: np.ndarray, what: str) -> None:
        """Raise InputError, naming axes or joints and distances, if a point (3,) or (J,) is outside."""
        beyond, unit = np.maximum(self.low - point, point - self.high), "" if self.joints else " m"
        rows = zip(self.joints or "xyz", point, beyond, self.low, self.high, strict=True)
        faults = [
            f"{axis} = {value:.4g}{unit} is {excess:.3g}{unit} {'below' if value < low else 'above'} "
            f"[{low:.4g}, {high:.4g}]"
            for axis, value, excess, low, high in rows
            if excess > 0.0
        ]
        if faults:
            raise InputError(f"{what} is outside the workspace of the skill: {'; '.join(faults)}")


@dataclass(frozen=True)
class ReactiveSkill:
    """Sequence of primitives, with feedback where they have networks. Raises InputError: parts do not fit."""

    # with quaternion orientations, or without orientation and without networks for rotations
    primitives: Sequence[PosePrimitive]
    # expected sensor traces by the primitive's name, all of the same channels
    expected: Mapping[str, VectorPrimitive] = field(default_factory=dict)
    networks: Networks = field(default_factory=dict)  # each takes all channels, or none (`pmnn.open_loop`)
    limits: Limits = field(default_factory=Limits)  # bounds of the feedback
    workspace: Workspace | None = None  # where runs may start and have goals; None: anywhere
    # names and numbers of channels of the sensors in a sample, in this order; optional
    sensors: tuple[tuple[str, int], ...] = ()
    # suggested stiffness of all primitives or of none (`primitives.stiffness`): (M, A) at equal parts of the
    # duration, along x, y, z in N/m and, with A = 6, about them in N m/rad
    stiffness: Mapping[str, np.ndarray] = field(default_factory=dict)
    joints: tuple[str, ...] = ()  # (J,) names, if it commands joints: the positions of all primitives
    outputs: tuple[str, ...] = ()  # (C,) names of the continuous outputs of all primitives
    digital: tuple[str, ...] = ()  # (B,) and of the digital ones

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
        self._require_widths()
        turned = any(map(turns, self.axes))
        for primitive in self.primitives:
            orientation = primitive.orientation
            if turned and orientation is None:
                raise InputError(f"'{primitive.name}' has no orientation, which feedback would correct")
            if not isinstance(orientation, QuaternionPrimitive | None):
                raise InputError(
                    f"the orientation of '{primitive.name}' is a {type(orientation).__name__}: the "
                    "controller steps quaternion primitives only, which turn less than half a circle"
                )
            if orientation is not None and orientation.rhythm != primitive.rhythm:
                raise InputError(f"position and orientation of '{primitive.name}' differ in their rhythms")
        for name, traces in self.expected.items():
            if (traces.rhythm is None) != (self.primitives[names.index(name)].rhythm is None):
                raise InputError(f"'{name}' or its expected traces have a rhythm, the other has none")
            if len(traces.start) != self.channels:
                raise InputError(
                    f"'{name}' has expected traces of {len(traces.start)} channels, others {self.channels}"
                )
        if self.stiffness and (
            set(self.stiffness) != set(names)
            or {profile.shape[1:] for profile in self.stiffness.values()} not in ({(3,)}, {(len(AXES),)})
            or not all(len(profile) > 1 and (profile > 0.0).all() for profile in self.stiffness.values())
        ):
            raise InputError("a stiffness is positive, on 3 or on 6 axes, of all primitives or of none")
        if self.sensors and sum(count for _, count in self.sensors) != self.channels:
            raise InputError(f"sensors {dict(self.sensors)} do not make up {self.channels} channels")
        for name, by_axis in self.networks.items():
            for axis, network in by_axis.items():
                what, expected = f"the network of '{name}' for {axis}", self.expected.get(name)
                if axis not in AXES:
                    raise InputError(f"'{name}' has a network for '{axis}', no axis among {', '.join(AXES)}")
                if network.inputs and (expected is None or network.inputs != len(expected.start)):
                    but = "there are no expected traces"
                    if expected is not None:
                        but = f"its expected traces have {len(expected.start)}"
                    raise InputError(f"{what} takes {network.inputs} channels, but {but}")
                if error := network.validation_error():
                    raise InputError(f"{what} {error}")
        self.limits.of(self.axes, 1.0)

    def _require_widths(self) -> None:
        """Raise InputError if primitives have other numbers of joints or outputs than the skill names."""
        if self.joints and self.networks:
            raise InputError("feedback corrects a pose, but the skill commands joints")
        if self.workspace is not None and self.workspace.joints != self.joints:
            raise InputError(f"the workspace is of {self.workspace.joints or 'a pose'}, not of the skill")
        for one in self.primitives:
            outputs, digital = one.outputs, one.switching
            for what, count, names in (
                ("coordinates", len(one.position.goal), self.joints or "xyz"),
                ("outputs", 0 if outputs is None else len(outputs.goal), self.outputs),
                ("digital outputs", 0 if digital is None else len(digital.first), self.digital),
            ):
                if count != len(names):
                    listing = ", ".join(names) or "none"
                    raise InputError(f"'{one.name}' has {count} {what}, the skill {len(names)}: {listing}")
            if bool(self.joints) != (one.position.frame == "none"):
                raise InputError(
                    f"'{one.name}' is {'a pose' if self.joints else 'of joints'}, unlike the skill"
                )

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Axes corrected by at least one network, in the order of `coupling.AXES`."""
        used = {axis for by_axis in self.networks.values() for axis in by_axis}
        return tuple(axis for axis in AXES if axis in used)

    @property
    def channels(self) -> int:
        """Number of sensor channels, 0 without expected traces."""
        return next((len(traces.start) for traces in self.expected.values()), 0)

    def repeated(self, cycles: Mapping[str, float]) -> Self:
        """The skill with other numbers of cycles, by name of a rhythmic primitive.

        The goals of these primitives, and the start of what follows, are where the cycle then is. Raises
        InputError: there is no such primitive, it is not rhythmic, or a number is not positive.
        """
        primitives = list(self.primitives)
        for name, number in cycles.items():
            place = self.index(name)
            try:
                primitives[place] = primitives[place].repeated(number)
            except (TypeError, ValueError) as error:
                raise InputError(f"cycles of '{name}': {error}") from error
        return replace(self, primitives=primitives)

    def index(self, primitive: int | str) -> int:
        """Index of a primitive, by name or index. Raises InputError: there is none."""
        names = [part.name for part in self.primitives]
        if primitive in names:
            return names.index(primitive)
        if not isinstance(primitive, int | np.integer) or not 0 <= primitive < len(names):
            raise InputError(f"there is no primitive {primitive!r} among {', '.join(names)}")
        return primitive


def real_numbers(values: Any, shape: tuple[int, ...], rule: str) -> np.ndarray:
    """Real numbers of a shape, NaN where a masked array is masked.

    Raises InputError, beginning with the rule: another shape, or anything else, e.g. text or bool.
    """
    try:
        array = np.asanyarray(values)
    except (TypeError, ValueError) as error:  # e.g. lists of differing lengths
        raise InputError(f"{rule}: {error}") from error
    if array.shape != shape:
        raise InputError(f"{rule}, got shape {array.shape}")
    if array.dtype.kind not in "iuf":
        raise InputError(f"{rule}, is {values!r}")
    return np.ma.filled(array.astype(float), np.nan) if isinstance(array, np.ma.MaskedArray) else array


JOINT_MARGIN = 0.1  # of the largest range of a joint: joints may be in rad, degrees or shares of a range


def demonstrated_workspace(
    paths: Iterable[np.ndarray], margin_m: float, joints: Sequence[str] = ()
) -> Workspace:
    """Smallest box around demonstrated paths (T, 3) in m, enlarged by a margin.

    Around paths (T, J) of `joints`, by `JOINT_MARGIN` instead.
    """
    points = np.concatenate(list(paths))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = JOINT_MARGIN * float(np.max(high - low)) if joints else margin_m
    return Workspace(low - margin, high + margin, tuple(joints))


def on_axis(networks: Mapping[str, CouplingModel], axis: Axis) -> Networks:
    """Networks of a skill that corrects on one axis, from networks by primitive."""
    return {name: {axis: network} for name, network in networks.items()}
