"""Interface of feedback networks: training, files, and evaluation by tick and by batch.

A network is a module of `feedback.models` with one subclass of `CouplingModel`, chosen in `params.yaml` by
the module's name. It is trained on a `CouplingDataset`, saved as its arrays, and evaluated by one compiled
kernel, which is called by the controller in its tick, by simulators in their loops, and by `coupling` for
batches:

    c = kernel(sizes, values, row, deviations, memory)                              (eq. IV.25)

`row`, one row of `table(p, u)`, holds everything that depends on time alone, so it is known in advance.
"""

import importlib
import json
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, Self, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from pydantic import Field, PositiveInt

from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.compilation import numba
from structlearn.core.errors import InputError
from structlearn.core.params import Name, Parameters
from structlearn.feedback import models
from structlearn.feedback.coupling_dataset import CouplingDataset, Fold, without_generalization
from structlearn.networks.compiled_layers import Array, Layers
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.primitive_files import part, prefixed

if TYPE_CHECKING:
    from structlearn.feedback.corrected_paths import CorrectedPaths


class TrainingParameters(Parameters):
    """Sample-by-sample training of a feedback model. Fields: `params.yaml`, `compare_models`."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    evaluate_every: PositiveInt
    chunk_samples: PositiveInt
    seed: int = Field(ge=0)


class UnrolledTrainingParameters(Parameters):
    """Training through the unroll. Fields: `params.yaml`, `train_feedback.unrolled`."""

    steps: int = Field(ge=1)
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    coupling_loss_weight: float = Field(ge=0)
    seed: int = Field(ge=0)


class NetworkParameters(Parameters):
    """Choice of the feedback network."""

    network: Name
    hidden: tuple[int, ...]

    @property
    def model(self) -> "type[CouplingModel]":
        """Class of the network. Raises InputError: there is none of this name."""
        return named_model(self.network)


Jobs = Sequence[tuple[CouplingDataset, Fold]]
"""Per model, its samples and the fold that splits them."""

Nodes = Sequence[int]  # width of each hidden layer

_NUMBERS = types.CPointer(types.float64)

kernel = numba.cfunc(
    types.float64(types.CPointer(types.int64), _NUMBERS, _NUMBERS, _NUMBERS, _NUMBERS), cache=True
)
"""Compile the forward pass of a network at one sample: (sizes, values, row, deviations, memory) -> c.

All arguments are pointers; `numba.carray(values, count)` makes arrays of them. The memory is 0 when a
movement begins, and persists from sample to sample.
"""


class Compiled(NamedTuple):
    """Arguments of a network's kernel that do not change from sample to sample."""

    sizes: np.ndarray  # (S,) integers
    values: np.ndarray  # (V,) floats
    memory: int  # number of values it remembers from sample to sample


@dataclass(frozen=True)
class CouplingModel(ABC):
    """Coupling term of one axis from sensor deviations and phase: a frozen dataclass of arrays and `Layers`.

    c should be 0 where the phase velocity u is 0, so that a movement starts smoothly and ends at its goal.
    """

    kernel: ClassVar[Any]  # compiled forward pass, see `kernel`

    @classmethod
    @abstractmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> "Sequence[Trained]":
        """Train one model per job.

        `jobs`: of equal sizes; they may differ in fold, target or deviation. `initial`: model to start from;
        its shape and input standardisation are kept. Raises InputError: too few samples, or a constant
        target.
        """

    def train_in_unroll(
        self, training: "CorrectedPaths", validation: "CorrectedPaths", parameters: UnrolledTrainingParameters
    ) -> "CouplingModel":
        """This model after further training in the unroll (`train_unrolled`), if its network supports it."""
        return self

    @property
    @abstractmethod
    def inputs(self) -> int:
        """Number of sensor channels; 0 for an open-loop model."""

    @property
    def kernel_count(self) -> int:
        """Number of phase kernels of the open-loop policy that approximates its executions."""
        return KERNEL_COUNT

    @abstractmethod
    def table(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The kernel's `row` (T, K) at phases (T,) and phase velocities (T,)."""

    @abstractmethod
    def compiled(self) -> Compiled:
        """The kernel's constant arguments."""

    def arrays(self) -> dict[str, np.ndarray]:
        """Fields of the model for its file; layers become `<field>.<number>.weights` and `.biases`."""
        found: dict[str, np.ndarray] = {}
        for field in fields(self):
            if field.type is np.ndarray:
                found[field.name] = getattr(self, field.name)
            else:
                for place, (weights, biases) in enumerate(getattr(self, field.name)):
                    name = f"{field.name}.{place}"
                    found |= {f"{name}.weights": weights, f"{name}.biases": biases}
        return found

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The inverse of `arrays`. Raises KeyError: an array is missing."""

        def layers(name: str) -> Layers:
            places = range(sum(key.startswith(f"{name}.") for key in arrays) // 2)
            return tuple((arrays[f"{name}.{at}.weights"], arrays[f"{name}.{at}.biases"]) for at in places)

        read: dict[Any, Callable[[str], Any]] = {np.ndarray: arrays.__getitem__, Layers: layers}
        return cls(**{field.name: read[field.type](field.name) for field in fields(cls)})

    def fault(self) -> str:
        """What is wrong with the model, phrased to follow "the network of ..."; empty if nothing is."""
        finite = all(np.isfinite(array).all() for array in self.arrays().values())
        return "" if finite else "holds a value that is not finite"

    def coupling(self, deviation: np.ndarray, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Coupling terms c (...) of a batch, by the compiled kernel.

        `deviation`: (..., D) sensor deviations, samples of a movement in order of time. `p`, `u`: of the
        batch's shape (...) or of its last axes. Raises ValueError: the network takes more channels.
        """
        *batch, channels = np.shape(deviation)
        if channels < self.inputs:
            raise ValueError(f"the network takes {self.inputs} channels, got {channels}")
        p, u = np.asarray(p, dtype=float), np.asarray(u, dtype=float)
        table = self.table(p.ravel(), u.ravel())
        table = np.broadcast_to(table.reshape(*p.shape, -1), (*batch, table.shape[-1]))
        return _batch(
            self.kernel.address,
            *self.compiled()[:2],
            np.ascontiguousarray(table, dtype=float).reshape(-1, table.shape[-1]),
            np.ascontiguousarray(deviation, dtype=float).reshape(table[..., 0].size, -1),
            np.zeros(self.compiled().memory),
            np.broadcast_to(p, batch).ravel(),
        ).reshape(batch)


Model = TypeVar("Model", bound=CouplingModel, covariant=True)


@dataclass(frozen=True)
class Trained(Generic[Model]):
    """Result of a training job."""

    # by the part that chose the step: `validation`, which is unbiased, and, if a demonstration was left out,
    # `generalization`, the dissertation's, which is optimistic
    models: dict[str, Model]
    steps: dict[str, int]  # gradient steps taken, likewise; 0 for training without steps
    code: float = np.nan  # dimensions that the deviations are compressed to; NaN without compression

    @classmethod
    def at_once(cls, model: CouplingModel) -> "Trained[CouplingModel]":
        """Result for a model that is trained without gradient steps."""
        parts = ("validation", "generalization")
        return Trained(dict.fromkeys(parts, model), dict.fromkeys(parts, 0))


def train_final(
    model: type[CouplingModel],
    dataset: CouplingDataset,
    parameters: TrainingParameters,
    hidden: Sequence[int] = (),
    initial: CouplingModel | None = None,
) -> CouplingModel:
    """Train the final model on all demonstrations, with early stopping on the validation part.

    Arguments and errors as in `CouplingModel.train`; refinement starts from an initial model.
    """
    fold = without_generalization(dataset, parameters.chunk_samples, parameters.seed)
    (trained,) = model.train([(dataset, fold)], parameters, hidden, initial)
    return trained.models["validation"]


def named_model(name: str) -> type[CouplingModel]:
    """Network class defined by a module of `feedback.models`. Raises InputError: there is no such module."""
    known = sorted(module.name for module in pkgutil.iter_modules(models.__path__))
    if name not in known:
        raise InputError(f"there is no feedback network '{name}' among {', '.join(known)}")
    module = importlib.import_module(f"{models.__name__}.{name}")
    found = [
        one
        for one in vars(module).values()
        if isinstance(one, type) and issubclass(one, CouplingModel) and one.__module__ == module.__name__
    ]
    if len(found) != 1:
        raise InputError(f"{module.__file__}: defines {len(found)} feedback networks, one is needed")
    return found[0]


def model_name(model: CouplingModel) -> str:
    """Module name of a network; the inverse of `named_model`."""
    return type(model).__module__.rpartition(".")[2]


def write_networks(networks: Sequence[tuple[str, CouplingModel]], path: str | Path) -> None:
    """Publish named networks, e.g. one per primitive, as one safetensors file with `<name>.<array>`."""
    tensors: dict[str, np.ndarray] = {}
    for name, network in networks:
        tensors |= prefixed(name, network.arrays())
    names = {name: model_name(network) for name, network in networks}
    write_tensors(tensors, path, json.dumps({"coupling_models": names}, sort_keys=True))


def read_networks(path: str | Path) -> dict[str, CouplingModel]:
    """Read a file of networks, by name. Raises InputError: another file, or a weight is not finite."""
    tensors = read_tensors(path)
    with holding(path, "feedback networks"):
        names = json.loads(read_description(path))["coupling_models"]
        found = {name: named_model(model).from_arrays(part(name, tensors)) for name, model in names.items()}
        for name, network in found.items():
            if fault := network.fault():
                raise InputError(f"the network of '{name}' {fault}")
    return found


@intrinsic
def _call(context, address, sizes, values, row, deviations, memory):
    """Call a kernel by address, so that code compiled earlier can call any network."""
    arrays = (sizes, values, row, deviations, memory)

    def generate(context, builder, signature, arguments):
        byte = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.DoubleType(), [byte] * len(arrays)).as_pointer()
        pointers = [
            builder.bitcast(context.make_array(kind)(context, builder, value).data, byte)
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        return builder.call(builder.inttoptr(arguments[0], function), pointers)

    return types.float64(types.int64, *arrays), generate


@numba.njit(cache=True, forceinline=True)
def evaluate(
    address: int, sizes: Array, values: Array, row: Array, deviations: Array, memory: Array
) -> float:
    """Coupling term at one sample, for compiled code; see `Compiled` and `kernel`."""
    return _call(address, sizes, values, row, deviations, memory)  # type: ignore[call-arg]  # numba adds one


@numba.njit(cache=True)
def _batch(
    address: int, sizes: Array, values: Array, table: Array, deviations: Array, memory: Array, p: Array
) -> np.ndarray:
    """Coupling terms (B,) of samples (B, D); a movement begins wherever the phase p (B,) increases."""
    found = np.empty(len(p))
    for k in range(len(p)):
        if k > 0 and p[k] > p[k - 1]:
            memory[:] = 0.0
        found[k] = evaluate(address, sizes, values, table[k], deviations[k], memory)
    return found
