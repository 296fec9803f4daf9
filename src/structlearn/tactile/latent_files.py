"""The file of trained latent spaces and dynamics: safetensors with the units that they see touch in."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import torch

from structlearn.ground.artefacts import read_tensors, write_tensors
from structlearn.ground.errors import InputError
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.units import TouchUnits

SEEDS = "seeds"
UNITS = "units."


def write_models(models: LatentModels, units: TouchUnits, path: str | Path) -> None:
    """Publish a stack of models and their units."""
    arrays = {name: values.numpy() for name, values in models.to_arrays().items()}
    arrays |= {f"{UNITS}{name}": np.asarray(values) for name, values in vars(units).items()}
    arrays[SEEDS] = np.array(models.seeds)
    write_tensors(
        arrays, path, "latent spaces of touch and their dynamics; structlearn.tactile.latent_models"
    )


def read_models(path: str | Path) -> tuple[LatentModels, TouchUnits]:
    """Read a stack of models and their units.

    Raises:
        InputError: the file is missing, damaged or holds something else.
    """
    arrays = read_tensors(path)
    try:
        units = TouchUnits(**{field.name: arrays.pop(UNITS + field.name) for field in fields(TouchUnits)})
        seeds = arrays.pop(SEEDS).tolist()
        tensors = {name: torch.from_numpy(values) for name, values in arrays.items()}
        return LatentModels.from_arrays(seeds, tensors), units
    except KeyError as error:
        raise InputError(f"{path}: holds no latent spaces of touch (missing {error})") from error
