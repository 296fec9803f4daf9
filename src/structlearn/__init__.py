"""Learning robot control and reactive planning with structured models (after Sutanto, USC 2020)."""

import os
import sys

__version__ = "0.1.0"

if os.environ.get("PYTHONPATH"):
    from structlearn.core import shadowing

    sys.excepthook = shadowing.report_hidden_import
