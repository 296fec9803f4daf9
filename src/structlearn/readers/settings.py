"""Settings of the environment that people corrected in: labels, or numbers where they are numbers.

`5`, `5.0` and 5 are one setting, called "5"; `tilt_left` is one too. A set of recordings of each is a folder
that has its label as its name.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from structlearn.core.errors import InputError
from structlearn.core.params import home_path


def setting_label(setting: Any) -> Any:
    """The label of a setting: of a number its shortest form, of any other text the text itself."""
    try:
        number = float(setting)
    except (TypeError, ValueError):
        return setting
    return f"{number + 0.0:g}" if math.isfinite(number) else str(setting)  # + 0.0: -0 is 0


Setting = Annotated[str, BeforeValidator(setting_label), Field(pattern=r"^-?\w[\w .+()-]*$")]
"""A setting in a parameter file: a number, which may be negative, or a name as of `core.params.NAME`."""


def setting_folders(source: str | Path, named: Sequence[str]) -> dict[str, Path]:
    """Folders of a source by the label of their setting: those that are named, then all others.

    Raises:
        InputError: there is no such folder, two of its folders are one setting, or one of those named is
            missing.
    """
    source = home_path(source)
    if not source.is_dir():
        raise InputError(f"{source}: no such folder")
    found: dict[str, Path] = {}
    for path in sorted(source.iterdir()):
        if path.is_dir() and not path.name.startswith("."):
            label = setting_label(path.name)
            if label in found:
                raise InputError(f"{path}: the setting {label} has another folder, {found[label].name}, too")
            found[label] = path
    missing = [label for label in named if label not in found]
    if missing:
        raise InputError(
            f"{source}: nothing was recorded in the setting {', '.join(missing)}; there are "
            f"{', '.join(found) or 'none'}"
        )
    return {label: found[label] for label in (*named, *(one for one in found if one not in named))}
