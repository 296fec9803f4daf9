"""Learning robot control and reactive planning with structured models (after Sutanto, USC 2020)."""

from pathlib import Path

from structlearn.core.compilation import use_own_cache

__version__ = "0.1.0"

use_own_cache(Path(__file__).parent)
