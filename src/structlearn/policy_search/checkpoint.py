"""Finished iterations of a refinement on disk, so that a killed run goes on where it was.

They lie outside DVC's outs, which DVC removes before a stage starts, in a folder named after all that decides
the result: other parameters or data find no iterations of theirs there. Whoever finishes removes the folder.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from pathlib import Path

import numpy as np

from structlearn.feedback.coupling_model import read_networks, write_networks
from structlearn.ground.artefacts import publish, read_table, read_tensors, write_table, write_tensors
from structlearn.ground.params import Parameters
from structlearn.ground.publication import discard
from structlearn.policy_search.refinement import Progress

NETWORK = "network"


@dataclass(frozen=True)
class Checkpoint:
    """Iterations of one refinement.

    Attributes:
        folder: of these iterations.
    """

    folder: Path

    def save(self, progress: Progress) -> None:
        """Write an iteration; it is there as a whole or not at all."""
        with publish(self.folder / f"{progress.iteration:03d}") as path:
            path.mkdir()
            write_networks([(NETWORK, progress.network)], path / "network.safetensors")
            arrays = {
                "covariance": progress.covariance,
                "policies": progress.policies,
                "compressed": progress.compressed,
            }
            write_tensors(arrays, path / "search.safetensors", "policy search: weights per phase kernel")
            write_table(progress.history, path / "history.parquet")
            write_table(progress.samples, path / "samples.parquet")

    def last(self) -> Progress | None:
        """The last finished iteration, None where there is none."""
        finished = sorted(path for path in self.folder.glob("[0-9]*") if path.is_dir())
        if not finished:
            return None
        path = finished[-1]
        arrays = read_tensors(path / "search.safetensors")
        return Progress(
            iteration=int(path.name),
            network=read_networks(path / "network.safetensors")[NETWORK],
            history=read_table(path / "history.parquet"),
            samples=read_table(path / "samples.parquet"),
            **arrays,
        )

    def remove(self) -> None:
        """Delete all iterations."""
        discard(self.folder)


def digest(values: Mapping[str, object]) -> str:
    """Name for all that decides a result: 16 hexadecimal digits.

    Args:
        values: by name; what JSON can hold, arrays, parameters and dataclasses of these.

    Raises:
        TypeError: a value of another kind, whose text might be the same for different contents.
    """
    text = json.dumps(dict(values), sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    """What JSON has no form for; arrays by their bytes, since their text leaves out the middle."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return [value.shape, value.dtype.str, hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Parameters):
        return value.model_dump()
    if is_dataclass(value):
        return vars(value)
    raise TypeError(f"a {type(value).__name__} cannot be part of a digest")
