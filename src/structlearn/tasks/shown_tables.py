"""Formatting of tables of recorded data: headings and number formats follow from the column names."""

import pandas as pd

from structlearn.reporting.document import Table

# By suffix of a column's name: its replacement in the heading, and the number format
UNITS = {
    "_n_m": (" (N m)", ".2f"),
    "_mm": (" (mm)", ".2f"),
    "_ms": (" (ms)", ".1f"),
    "_kg": (" (kg)", ".2f"),
    "_m": (" (m)", ".3f"),
    "_deg": (" (°)", ".2f"),
    "_s": (" (s)", ".2f"),
    "_hz": (" (Hz)", ".1f"),
    "_counts": (" (counts)", ".1f"),
    "_share": (" (share)", ".1%"),
    "": ("", ".3g"),
}

# Words of column names that headings replace
WORDS = {"way": "model", "max": "largest", "nmse": "NMSE", "rms": "RMS"}


def shown(frame: pd.DataFrame, strong: frozenset[int] = frozenset(), /, **formats: str) -> Table:
    """A table with headings and formats from its column names; `formats` are exceptions."""
    headings, found = {}, {}
    for name in frame:
        ending = next(ending for ending in UNITS if str(name).endswith(ending))
        unit, found[name] = UNITS[ending]
        words = str(name).removesuffix(ending).split("_")
        headings[name] = " ".join(WORDS.get(word, word) for word in words) + unit
        if pd.api.types.is_integer_dtype(frame[name]):
            found[name] = ""
    return Table(frame, found | formats, headings, strong)
