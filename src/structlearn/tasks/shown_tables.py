"""Display of recorded-data tables: headings and number formats from column names."""

import pandas as pd

from structlearn.reporting.document import Table

# Heading suffix and number format, by suffix of the column name
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

# Words of column names that are replaced in headings
WORDS = {"max": "largest", "nmse": "NMSE", "rms": "RMS"}


def shown(frame: pd.DataFrame, strong: frozenset[int] = frozenset(), /, **formats: str) -> Table:
    """Table with headings and formats derived from its column names; `formats` override."""
    headings, found = {}, {}
    for name in frame:
        ending = next(ending for ending in UNITS if str(name).endswith(ending))
        unit, found[name] = UNITS[ending]
        words = str(name).removesuffix(ending).split("_")
        headings[name] = " ".join(WORDS.get(word, word) for word in words) + unit
        if pd.api.types.is_integer_dtype(frame[name]):
            found[name] = ""
    return Table(frame, found | formats, headings, strong)
