"""Parquet tables that others wrote."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pyarrow
import pyarrow.parquet

from structlearn.core.errors import InputError
from structlearn.core.reading import LARGEST, require_file


def read_parquet(path: Path, needed: Sequence[str] | None = None) -> pd.DataFrame:
    """Some columns of a table, by default all; words become categories, since few may stand for many.

    Raises InputError: the file is missing, damaged, or too large in memory; a column is missing or stands
    twice.
    """
    try:
        require_file(path, whole=False)
        schema = pyarrow.parquet.read_schema(path)
        names = list(schema.names if needed is None else needed)
        if missing := [name for name in names if name not in schema.names]:
            raise InputError(f"{path}: has no column {', '.join(missing)}; it has {', '.join(schema.names)}")
        if len(set(schema.names)) < len(schema.names):
            raise InputError(f"{path}: a column stands twice among {', '.join(schema.names)}")
        words = [one.name for one in schema if one.type in (pyarrow.string(), pyarrow.binary())]
        with pyarrow.parquet.ParquetFile(
            path, page_checksum_verification=True, read_dictionary=words
        ) as file:
            about = file.metadata
            parts = [about.row_group(number) for number in range(about.num_row_groups)]
            counts = [part.column(place).num_values for part in parts for place in range(about.num_columns)]
            if 8 * max(sum(counts), about.num_rows * about.num_columns) > LARGEST:
                raise InputError(
                    f"{path}: has {about.num_rows} rows of {about.num_columns} columns, too many"
                )
            return file.read(columns=names).to_pandas()
    except InputError:
        raise
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise InputError(f"{path}: not a Parquet file that can be read: {error}") from error
