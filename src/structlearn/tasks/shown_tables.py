"""How the tables of the recorded data are written: headings and formats follow from the names of columns."""

import pandas as pd

from structlearn.reporting.document import Table

# By the end of a column's name: what is written instead in its heading, and how its numbers are written.
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

# Of columns' names, that a heading writes otherwise.
WORDS = {"way": "model", "max": "largest", "nmse": "NMSE", "rms": "RMS"}


def shown(frame: pd.DataFrame, strong: frozenset[int] = frozenset(), /, **formats: str) -> Table:
    """A table whose headings and formats follow from the names of its columns; `formats` are exceptions."""
    headings, found = {}, {}
    for name in frame:
        ending = next(ending for ending in UNITS if str(name).endswith(ending))
        unit, found[name] = UNITS[ending]
        words = str(name).removesuffix(ending).split("_")
        headings[name] = " ".join(WORDS.get(word, word) for word in words) + unit
        if pd.api.types.is_integer_dtype(frame[name]):
            found[name] = ""
    return Table(frame, found | formats, headings, strong)
