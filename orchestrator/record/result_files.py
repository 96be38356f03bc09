"""Opens files of tables of results: whole ones, of this foretwin's schema."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.futures.checked_parquet import parquet_file
from foretwin.sim_worker.futures.columns import RESULT_SCHEMA_VERSION


@contextmanager
def opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a file of a table; all that damage in it can raise is a UserError that names it.

    Raises FileNotFoundError where there is none.
    """
    try:
        with parquet_file(path) as file:
            yield file
    except (UserError, FileNotFoundError):
        raise
    except (OSError, pa.ArrowException, KeyError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error


def check_result_schema(path: Path, schema: pa.Schema) -> dict[str, str]:
    """Return the metadata of a table; UserError where another foretwin wrote it."""
    said = {key.decode(): value.decode() for key, value in (schema.metadata or {}).items()}
    if said.get("result_schema") != str(RESULT_SCHEMA_VERSION):
        raise UserError(
            f"{path}: written by another foretwin (schema of results "
            f"{said.get('result_schema', 'not told')}; this one reads {RESULT_SCHEMA_VERSION})"
        )
    return said
