"""Interface of feedback networks: files, and evaluation by tick and by batch.

A network is a module of `feedback.models` with one subclass of `CouplingModel`, which is saved as its arrays
and evaluated by one compiled kernel: called by the controller in its tick, by simulators in their loops, and
by `coupling` for batches:

    c = kernel(sizes, values, row, deviations, memory)                              (eq. IV.25)

`row`, one row of `time_features(p, u)`, holds everything that depends on time alone, so it is known in
advance. `feedback.trainers` trains networks.
"""

import importlib
import json
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.compilation import call, numba
from structlearn.core.compilation import kernel as kernel  # for networks of one's own
from structlearn.core.errors import InputError
from structlearn.feedback import models
from structlearn.networks.compiled_layers import Array, Layers
from structlearn.primitives.kernels import KERNEL_COUNT
from structlearn.primitives.primitive_files import prefixed, tensors_below


class Compiled(NamedTuple):
    """Arguments of a network's kernel that do not change from sample to sample."""

    sizes: np.ndarray  # (S,) integers, e.g. widths of layers
    values: np.ndarray  # (V,) floats, e.g. weights
    memory: int  # number of values it remembers from sample to sample


@dataclass(frozen=True)
class CouplingModel(ABC):
    """Coupling term of one axis from sensor deviations and phase: a frozen dataclass of arrays and `Layers`.

    c should be 0 where the phase velocity u is 0, so that a movement starts smoothly and ends at its goal.
    """

    kernel: ClassVar[Any]  # compiled forward pass, decorated with `core.compilation.kernel`

    @property
    @abstractmethod
    def inputs(self) -> int:
        """Number of sensor channels; 0 for an open-loop model."""

    @property
    def kernel_count(self) -> int:
        """Number of phase kernels of the open-loop policy that approximates its executions."""
        return KERNEL_COUNT

    @abstractmethod
    def time_features(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The kernel's `row` (T, K) at phases (T,) and phase velocities (T,)."""

    @abstractmethod
    def compiled(self) -> Compiled:
        """The kernel's constant arguments."""

    def arrays(self) -> dict[str, np.ndarray]:
        """Fields of the model for its file; layers become `<field>.<number>.weights` and `.biases`."""
        arrays: dict[str, np.ndarray] = {}
        for field in fields(self):
            if field.type is np.ndarray:
                arrays[field.name] = getattr(self, field.name)
            else:
                for number, (weights, biases) in enumerate(getattr(self, field.name)):
                    name = f"{field.name}.{number}"
                    arrays |= {f"{name}.weights": weights, f"{name}.biases": biases}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The inverse of `arrays`. Raises KeyError: an array is missing."""

        def layers(name: str) -> Layers:
            places = range(sum(key.startswith(f"{name}.") for key in arrays) // 2)
            return tuple((arrays[f"{name}.{at}.weights"], arrays[f"{name}.{at}.biases"]) for at in places)

        read: dict[Any, Callable[[str], Any]] = {np.ndarray: arrays.__getitem__, Layers: layers}
        return cls(**{field.name: read[field.type](field.name) for field in fields(cls)})

    def validation_error(self) -> str:
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
        rows = self.time_features(p.ravel(), u.ravel())
        rows = np.broadcast_to(rows.reshape(*p.shape, -1), (*batch, rows.shape[-1]))
        compiled = self.compiled()
        return _batch(
            self.kernel.address,
            compiled.sizes,
            compiled.values,
            np.ascontiguousarray(rows, dtype=float).reshape(-1, rows.shape[-1]),
            np.ascontiguousarray(deviation, dtype=float).reshape(rows[..., 0].size, -1),
            np.zeros(compiled.memory),
            np.broadcast_to(p, batch).ravel(),
        ).reshape(batch)


def named_model(name: str) -> type[CouplingModel]:
    """Network class defined by a module of `feedback.models`. Raises InputError: there is no such module."""
    known = sorted(module.name for module in pkgutil.iter_modules(models.__path__))
    if name not in known:
        raise InputError(f"there is no feedback network '{name}' among {', '.join(known)}")
    module = importlib.import_module(f"{models.__name__}.{name}")
    own = [value for value in vars(module).values() if getattr(value, "__module__", "") == module.__name__]
    classes = [value for value in own if isinstance(value, type) and issubclass(value, CouplingModel)]
    if len(classes) != 1:
        raise InputError(f"{module.__file__}: defines {len(classes)} feedback networks, one is needed")
    return classes[0]


def module_name(model: CouplingModel) -> str:
    """Module name of a network; the inverse of `named_model`."""
    return type(model).__module__.rpartition(".")[2]


def write_networks(networks: Sequence[tuple[str, CouplingModel]], path: str | Path) -> None:
    """Publish named networks, e.g. one per primitive, as one safetensors file with `<name>.<array>`."""
    tensors: dict[str, np.ndarray] = {}
    for name, network in networks:
        tensors |= prefixed(name, network.arrays())
    names = {name: module_name(network) for name, network in networks}
    write_tensors(tensors, path, json.dumps({"coupling_models": names}, sort_keys=True))


def read_networks(path: str | Path) -> dict[str, CouplingModel]:
    """Read a file of networks, by name. Raises InputError: another file, or a weight is not finite."""
    tensors = read_tensors(path)
    with holding(path, "feedback networks"):
        names = json.loads(read_description(path))["coupling_models"]
        networks = {
            name: named_model(model).from_arrays(tensors_below(name, tensors))
            for name, model in names.items()
        }
        for name, network in networks.items():
            if error := network.validation_error():
                raise InputError(f"the network of '{name}' {error}")
    return networks


@numba.njit(cache=True)
def _batch(
    address: int, sizes: Array, values: Array, rows: Array, deviations: Array, memory: Array, p: Array
) -> np.ndarray:
    """Coupling terms (B,) of samples (B, D); a movement begins wherever the phase p (B,) increases."""
    terms = np.empty(len(p))
    for k in range(len(p)):
        if k > 0 and p[k] > p[k - 1]:
            memory[:] = 0.0
        terms[k] = call(address, sizes, values, rows[k], deviations[k], memory)
    return terms
