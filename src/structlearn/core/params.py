"""Parameters: `params.yaml` has one key per stage, checked by a pydantic model per stage.

A model is defined beside the code that it configures (for training code, in a module without torch, so that
pages start quickly) and has no defaults: each value is in the file, once. This module holds what all models
share. The file is read by YAML's C loader, once per process; `dvc.api.params_show` takes 0.7 s per stage.
"""

import re
import reprlib
from collections.abc import Hashable, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import yaml
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from structlearn.core.errors import InputError
from structlearn.core.used_files import remember, remember_value, require_regular


class Parameters(BaseModel):
    """Base of all parameter models: unknown keys, NaN and infinities are errors; values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_value_is_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Reject booleans for numbers: YAML reads `yes` and `on` as true, and pydantic would take 1."""
        numbers = (value, *value) if isinstance(value, list | tuple) else (value,)
        if any(isinstance(number, bool) for number in numbers):
            assert info.field_name is not None  # a validator of fields, not of the model
            allowed = str(cls.model_fields[info.field_name].annotation)
            if "bool" not in allowed and "Any" not in allowed:
                raise ValueError("is true or false, as YAML also reads yes, no, on and off; not allowed here")
        return value


NAME = r"^\w[\w .+()-]*$"
"""Names are used in file names, figure labels (where $ starts a formula) and cells (where = and @ do)."""

Name = Annotated[str, Field(pattern=NAME, max_length=100)]

ParametersType = TypeVar("ParametersType", bound=Parameters)


def read_parameters(path: Path, key: str, model: type[ParametersType]) -> ParametersType:
    """Validate the value of one key of a YAML file, e.g. `testbed.touch`, against its model.

    Raises InputError: the file is missing or is not a YAML mapping, the key is absent, a key is duplicate, or
    a value is missing, unknown, of the wrong type or out of range; the message names file, key and reason.
    """
    return checked(value_at(path, key), model, path, key)


def value_at(path: str | Path, key: str) -> Any:
    """Unvalidated value at a dotted key of a YAML file, read-only. Raises InputError: it is absent.

    While a stage runs, the file may change elsewhere, see `used_files`.
    """
    value = _value_at(path, key)
    remember_value(path, key, value, partial(_present, path, key))
    return value


def _present(path: str | Path, key: str) -> Any:
    """Value at a key, or the error if there is none any more."""
    try:
        return _value_at(path, key)
    except InputError as error:
        return error


def _value_at(path: str | Path, key: str) -> Any:
    values = read_values(path, whole=False)
    for part in key.split("."):
        if not isinstance(values, dict) or part not in values:
            raise InputError(f"{path}: key '{key}' is missing")
        values = values[part]
    return values


def read_values(path: str | Path, whole: bool = True) -> Any:
    """Unvalidated contents of a YAML file, read-only. Raises InputError: missing, invalid, duplicate keys.

    `whole`: all of it is used, and none may change while a stage runs; otherwise see `value_at`.
    """
    path = Path(path)
    try:
        require_regular(path)
        if whole:
            remember(path)
        state = path.stat()
        return _tree(path.resolve(), state.st_mtime_ns, state.st_size)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such parameter file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except InputError:
        raise
    except _DuplicateKeyError as error:
        raise InputError(f"{path}: {error}") from error
    except Exception as error:  # from YAML, or from an invalid date, number, tag or byte
        raise InputError(f"{path}: not a YAML file: {error}") from error


def home_path(path: str | Path) -> Path:
    """A path with `~` expanded to the home folder. Raises InputError: there is no such user."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise InputError(f"{path}: there is no such home folder") from error


def checked(values: Any, model: type[ParametersType], path: str | Path, key: str) -> ParametersType:
    """Validated values. Raises InputError: missing, unknown, of the wrong type or out of range."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InputError(f"{path}: " + "; ".join(_reasons(key, error))) from error


def merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A mapping with some values changed; nested mappings are merged recursively."""
    result = dict(values)
    for name, change in changes.items():
        before = result.get(name)
        if isinstance(before, Mapping) and isinstance(change, Mapping):
            change = merged(before, change)
        result[name] = change
    return result


@lru_cache(maxsize=4)
def _tree(path: Path, modified_ns: int, size: int) -> Any:
    """Contents of one version of a file, read-only."""
    text = path.read_bytes().decode()
    brackets = np.cumsum([1 if bracket in "[{" else -1 for bracket in re.findall(r"[\[\]{}]", text)])
    levels = (len(line) - len(re.sub(r"^[\s?-]*", "", line)) for line in text.splitlines())
    if max(brackets, default=0) > DEEPEST or max(levels, default=0) > DEEPEST:
        raise ValueError("nested too deeply")  # the C loader would crash the process
    return yaml.load(text, _Loader)


DEEPEST = 1000
"""Limit on nested brackets, and on blanks, dashes and question marks at the start of a line: each level of
YAML needs at least one."""


class _DuplicateKeyError(ValueError):
    """Duplicate key; YAML itself would silently take the last value."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # libyaml or not
    """YAML's safe loader, in C if available; duplicate keys are errors."""

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """An integer short enough to print; Python limits decimal digits, but not hexadecimal ones."""
        value = super().construct_yaml_int(node)
        str(value)
        return value

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """A mapping without duplicate keys."""
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise _DuplicateKeyError(
                    f"key '{key.value}' is defined twice (line {key.start_mark.line + 1})"
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)


def _reasons(key: str, error: ValidationError) -> list[str]:
    """One phrase per error, with the dotted path of the key, e.g. `segment.extension_s: ... (got -1)`."""
    reasons = []
    for fault in error.errors():
        where = ".".join([key, *(str(part) for part in fault["loc"])])
        if fault["type"] == "extra_forbidden":
            reasons.append(f"{where}: unknown parameter")
        elif isinstance(fault["input"], dict) and "error" in fault.get(
            "ctx", {}
        ):  # from a validator of several values
            reasons.append(f"{where}: {fault['ctx']['error']}")
        else:
            reasons.append(f"{where}: {fault['msg']} (got {reprlib.repr(fault['input'])})")
    return reasons


Seeds = Annotated[list[NonNegativeInt], Field(min_length=1)]


class Population(Parameters):
    """Seeds of people, robots or scenes: constants are tuned on `tuning`, verdicts rest on `test`."""

    tuning: Seeds
    test: Seeds

    @model_validator(mode="after")
    def _are_apart(self) -> "Population":
        for name in ("tuning", "test"):
            seeds = getattr(self, name)
            if len(set(seeds)) < len(seeds):
                raise ValueError(f"a seed of `{name}` is defined twice: {seeds}")
        if shared := sorted(set(self.tuning) & set(self.test)):
            raise ValueError(f"seeds {shared} are in `tuning` and in `test`: nothing may be judged on them")
        return self

    @property
    def shown(self) -> int:
        """Seed shown in recordings and first figures."""
        return self.tuning[0]
