"""Stops pytest in one line if PYTHONPATH hides a package, and pins libraries, before `conftest` loads any."""

import sys

from structlearn.core.errors import InputError
from structlearn.core.processor import pin
from structlearn.core.shadowing import require_own_packages

try:
    require_own_packages()
except InputError as error:
    sys.exit(f"error: {error}")
pin()
