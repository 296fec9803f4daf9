"""Kinds of data. A kind is a package; each of its modules has one part of the protocol.

    parameters.Entry                          model of a task's entry
    recordings.write(task, folder, left_out)  reads a task's source, and writes what later stages need
    learning.learn(files, folder)             what is learned from it, in `TaskFiles.learned`
    page.sections(files)                      sections of the task's page
    view.recordings(files)                    for rerun, by name; `view.NOTHING`: why there are none

Movements are learned in several stages instead of one. In an entries file, a kind has its short name, or is
the dotted name of a package elsewhere, whose defaults are in its `params.yaml`.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from structlearn.core.errors import InputError
from structlearn.core.params import read_values, value_at
from structlearn.tasks import project

KINDS = ("movement", "motion", "touch", "obstacles")


def module_of(kind: str, name: str) -> ModuleType:
    """Module of a kind. Raises InputError: there is no such kind."""
    package = kind if "." in kind else f"{__package__}.{kind}"
    try:
        if kind in KINDS or "." in kind:
            return import_module(f"{package}.{name}")
    except ModuleNotFoundError as error:
        if not f"{package}.{name}".startswith(str(error.name)):
            raise
    raise InputError(f"{kind}: there is no such kind among {', '.join(KINDS)}")


def kind_defaults(kind: str) -> dict[str, Any]:
    """Defaults of a kind's entries."""
    if kind in KINDS:
        return value_at(project.DEFAULTS, f"defaults.{kind}")
    return read_values(Path(module_of(kind, "parameters").__file__ or "").with_name("params.yaml"))
