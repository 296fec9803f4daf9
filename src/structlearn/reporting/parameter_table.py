"""The parameters that a page's results were made with, one row each."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from structlearn.ground.params import Parameters


def parameter_table(parameters: Mapping[str, Parameters]) -> pd.DataFrame:
    """One row per parameter, named as for `dvc exp run --temp -S`.

    Args:
        parameters: by their key in `params.yaml`.
    """
    rows = [row for key, model in parameters.items() for row in _rows(key, model.model_dump(mode="json"))]
    return pd.DataFrame(rows, columns=["parameter", "value"])


def _rows(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Dotted name and value of every leaf; lists of plain values are one leaf, as are named entries."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _rows(f"{key}.{name}", inner)
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for place, inner in enumerate(value):
            yield f"{key}.{place}", ", ".join(f"{name} {_text(leaf)}" for name, leaf in inner.items())
    else:
        yield key, _text(value)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_text(inner) for inner in value) or "\N{EN DASH}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "\N{EN DASH}"
    return f"{value:g}" if isinstance(value, float) else str(value)
