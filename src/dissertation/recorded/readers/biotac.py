"""Public recordings of BioTac fingers, collected from several sets: slides, unscrewing and scraping.

`$DATA` holds `slide` and `clmc`, or one of them; recordings are called SET/NAME.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from dissertation.recorded.readers import clmc, slide
from structlearn.core.errors import MissingInputError
from structlearn.readers.demonstration import Recording


def read_transfer(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """The first `entry.part` slides over each material, all logs of unscrewing, an execution of scraping."""
    readers: dict[str, Callable[[], list[Recording]]] = {
        "scraping": lambda: clmc.read_scraping_execution(folder / "clmc"),
        "slides": lambda: slide.read_slides(folder / "slide", entry.part, left_out),
        "unscrewing": lambda: clmc.read_unscrewing(folder / "clmc", left_out),
    }
    found = []
    for name, read in readers.items():
        try:
            found += [replace(one, name=f"{name}/{one.name}") for one in read()]
        except MissingInputError as missing:
            print(f"biotac: without {name}: {missing}")
    if not found:
        raise MissingInputError(f"{folder}: holds no slides, unscrewing or scraping")
    return found
