"""A table of results in parts: those that were put away, `NAME-001.parquet` and on, and the last
one, `NAME.parquet`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from foretwin.sim_worker.futures.checked_parquet import read_parquet

_PUT_AWAY = re.compile(r"(.+)-(\d{3,})")


def put_away_name(last: Path, number: int) -> Path:
    """Return what an earlier part of a table is called, by the name of its last one."""
    return last.with_name(f"{last.stem}-{number:03d}{last.suffix}")


def table_of(part: Path) -> str | None:
    """Return which table a file is a part of that was put away; None where it is none."""
    named = _PUT_AWAY.fullmatch(part.stem)
    return None if named is None else named[1]


def parts_of_table(last: Path) -> list[Path]:
    """Return the files of a table that are there, the oldest first."""
    numbered = [
        (int(named[2]), path)
        for path in last.parent.glob(f"{last.stem}-*{last.suffix}")
        if (named := _PUT_AWAY.fullmatch(path.stem)) and named[1] == last.stem
    ]
    return [*(path for _, path in sorted(numbered)), *([last] if last.exists() else [])]


def next_part(last: Path) -> Path:
    """Return the name under which the last part is put away; Parquet of earlier ones counts."""
    numbers = [
        int(named[2])
        for path in last.parent.iterdir()
        if (named := _PUT_AWAY.fullmatch(path.stem)) and named[1] == last.stem
    ]
    return put_away_name(last, max(numbers, default=0) + 1)


def read_parts(last: Path, *, columns: Sequence[str] | None = None) -> pa.Table:
    """Return the rows of all parts of a table; raises OSError or pa.ArrowException."""
    parts = parts_of_table(last) or [last]
    return pa.concat_tables([read_parquet(part, columns) for part in parts])
