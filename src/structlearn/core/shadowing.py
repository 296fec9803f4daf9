"""Packages of this environment that PYTHONPATH hides behind others of the same name, e.g. those of ROS.

`source /opt/ros/DISTRIBUTION/setup.bash` puts ROS's own packages before those that are installed here, which
were built for another Python or are of another version. Commands and stages refuse that; who imports the
library, as a ROS node does, is told when such an import fails. Loads nothing but the standard library.
"""

import os
import pkgutil
import re
import sys
import traceback
from pathlib import Path
from types import TracebackType

from structlearn.core.errors import InputError

VARIABLE = "PYTHONPATH"
OUR_OWN = "structlearn"  # whoever names its sources there means it
_previous_hook = sys.excepthook


def shadowed() -> dict[str, str]:
    """Folder of PYTHONPATH that each hidden package is loaded from, by the package's name."""
    named = [os.path.abspath(folder) for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]
    foreign = [folder for folder in named if not Path(folder).resolve().is_relative_to(sys.prefix)]
    if not foreign:
        return {}
    installed = [folder for folder in sys.path if "-packages" in folder and folder not in named]
    here = {module.name for module in pkgutil.iter_modules(installed)} - {OUR_OWN}
    # of a name that is in several folders the first counts
    return {
        module.name: folder
        for folder in reversed(foreign)
        for module in pkgutil.iter_modules([folder])
        if module.name in here
    }


def require_own_packages() -> None:
    """Raise InputError if PYTHONPATH hides a package of this environment."""
    for name, folder in shadowed().items():
        raise InputError(_message(name, folder))


def report_hidden_import(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Report an import that failed in a package hidden by PYTHONPATH in one line: a `sys.excepthook`."""
    if isinstance(error, ImportError):
        files = [frame.f_code.co_filename for frame, _ in traceback.walk_tb(trace)]
        for name, folder in shadowed().items():
            within = any(file.startswith(os.path.join(folder, name)) for file in files)
            if within or re.search(rf"\b{re.escape(name)}\b", str(error), re.IGNORECASE):
                print(f"error: {_message(name, folder)}", file=sys.stderr)
                return
    _previous_hook(kind, error, trace)


def _message(name: str, folder: str) -> str:
    return f"{name} is loaded from {folder}, which {VARIABLE} names, not from {sys.prefix}; unset {VARIABLE}"
