"""Parameters: `params.yaml` holds one key per stage, a pydantic model per stage checks it.

The model lives beside the code that it configures; here is only what all of them share. The file is read
with `yaml.safe_load` because `dvc.api.params_show` costs 0.7 s a stage.
"""

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from structlearn.ground.errors import InputError


class Parameters(BaseModel):
    """Base of every parameter model: unknown keys, NaN and infinities are errors; values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


ParametersType = TypeVar("ParametersType", bound=Parameters)


def read_parameters(path: Path, key: str, model: type[ParametersType]) -> ParametersType:
    """Check the value of one top-level key of a YAML file against its model.

    Args:
        path: the YAML file, usually `params.yaml`.
        key: the stage's key at the top level.
        model: the pydantic model of that key.

    Returns:
        The checked, frozen parameters.

    Raises:
        InputError: the file is missing or no YAML mapping, the key is absent, or a value is unknown, of the
            wrong type or out of range; the message names file, key and reason.
    """
    try:
        tree: Any = yaml.safe_load(Path(path).read_text())
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such parameter file") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a YAML file: {error}") from error
    if not isinstance(tree, dict) or key not in tree:
        raise InputError(f"{path}: key '{key}' is missing")
    try:
        return model.model_validate(tree[key])
    except ValidationError as error:
        raise InputError(f"{path}: " + "; ".join(_reasons(key, error))) from error


def _reasons(key: str, error: ValidationError) -> list[str]:
    """One phrase per fault, with the dotted path of the key, e.g. `segment.extension_s: ... (got -1)`."""
    reasons = []
    for fault in error.errors():
        where = ".".join([key, *(str(part) for part in fault["loc"])])
        if fault["type"] == "extra_forbidden":
            reasons.append(f"{where}: unknown parameter")
        else:
            reasons.append(f"{where}: {fault['msg']} (got {fault['input']!r})")
    return reasons
