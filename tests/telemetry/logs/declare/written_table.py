"""Columns of several clocks written into one table: rows blank or repeated, names or none."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array

TIMES = {"s": 1e-9, "ms": 1e-6, "us": 1e-3, "ns": 1.0}


class Written(NamedTuple):
    """A column to be: stamps, numbers as they are written, their decimals, and what they are."""

    stamps_ns: Any
    values: Array
    decimals: int
    field: str


def write_table(
    path: Path, columns: list[Written], *, unit: str, names: dict[str, str] | None, layout: str,
    pick: Callable[..., Any], answers: dict[str, str],
) -> None:  # fmt: skip
    every = np.unique(np.concatenate([column.stamps_ns for column in columns]))
    if layout != "blank":
        fastest = max((column.stamps_ns for column in columns), key=len)
        every = fastest
    called: list[str] = []
    cells: list[Array] = []
    counters: dict[int, Array] = {}
    for column in columns:
        at = np.searchsorted(column.stamps_ns, every, side="right") - 1
        inside = (at >= 0) & (every <= column.stamps_ns[-1] + 10**9)
        if layout == "blank":
            inside &= column.stamps_ns[np.maximum(at, 0)] == every
        cells.append(
            np.where(inside, np.round(column.values, column.decimals)[np.maximum(at, 0)], np.nan)
        )
        called.append(column.field if names is None else names.get(column.field, column.field))
        counters[id(column.stamps_ns)] = np.where(inside, at, np.nan).astype(float)
    if layout == "held with counters":
        for number, values in enumerate(counters.values()):
            cells.append(values)
            called.append(f"n{number}")
    place = pick(0, len(cells) // 2)
    fields = [column.field for column in columns]
    if unit == "iso8601":
        moments = every.astype("datetime64[ns]").astype("datetime64[us]")
        times: Any = np.array([f"{moment}Z" for moment in moments.astype(str)])
    else:
        times = (
            every
            if unit == "ns"
            else np.round(every * TIMES[unit], {"s": 6, "ms": 3, "us": 0}[unit])
        )
    called.insert(place, "time" if names is None else names["time"])
    fields.insert(place, "time")
    headless = names is None and pick(True, False) and path.suffix != ".parquet"
    if names is None:
        called = [f"c{number}" for number in range(1, len(called) + 1)]
    texts = [_texts(column) for column in cells]
    texts.insert(place, _texts(times))
    for key in ("latitude", "x"):
        if key in fields:
            answers[key] = called[fields.index(key)]
    if path.suffix == ".parquet":
        _write_parquet(path, called, [*cells[:place], times, *cells[place:]])
        return
    sign = "\t" if path.suffix == ".tsv" else pick(",", ";")
    comma = sign == ";" and pick(True, False)
    lines = [] if headless else [sign.join(called)]
    for row in zip(*texts, strict=True):
        line = sign.join(row)
        lines.append(line.replace(".", ",") if comma and unit != "iso8601" else line)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _texts(values: Any) -> list[str]:
    if values.dtype.kind in "iU":
        return [str(value) for value in values.tolist()]
    return ["" if math.isnan(value) else repr(value) for value in values.tolist()]


def _write_parquet(path: Path, names: list[str], columns: list[Any]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = [
        pa.array(column) if column.dtype.kind in "iU" else pa.array(column, from_pandas=True)
        for column in columns
    ]
    pq.write_table(pa.table(dict(zip(names, arrays, strict=True))), path)
