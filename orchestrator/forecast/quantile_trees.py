"""A table of boosted trees for quantiles, evaluated by numpy alone: the same bits everywhere.

Leaves are whole numbers, so that their sum hangs on no order of adding; features are compared with
thresholds and nothing else is computed of them.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file

LEAF_UNIT_MPS2 = 1e-6
"""What one is worth in a leaf."""
TABLE_VERSION = 1
MOST_NODES = 1_000_000
"""A larger file is no table: the shipped one has some ten thousand."""
_FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""Of every file in the table, so that the same table has the same bytes."""

Whole = npt.NDArray[np.int64]


class QuantileTrees(NamedTuple):
    """M nodes of all trees, and what a table says of itself.

    `feature` (M,) is a place in `features`, `threshold` (M,): what is at most so large goes to
    `left`, else to `right`, and what is no number to `left` where `missing_left`. Leaves lead to
    themselves and have a `value` in `LEAF_UNIT_MPS2`. Trees begin at `roots` (R,), and those of
    level k of `levels` are `roots[trees[k]:trees[k + 1]]`. `shares` (T, L) say which share of
    drives that were not learnt from came below each level, at each of `time_s` (T,).
    """

    features: tuple[str, ...]
    levels: Array
    time_s: Array
    feature: Whole
    threshold: Array
    left: Whole
    right: Whole
    missing_left: Flags
    value: Whole
    roots: Whole
    trees: Whole
    base: Whole
    shares: Array
    words: dict[str, str]

    @property
    def depth(self) -> int:
        """How many steps lead from any root to a leaf."""
        steps, at = 0, self.roots
        while not (self.left[at] == at).all():
            at = np.unique(np.concatenate([self.left[at], self.right[at]]))
            steps += 1
        return steps

    def values(self, rows: Array, depth: int) -> Array:
        """Return (T, L) what the trees say to rows of features (T, F), in m/s²."""
        at = np.broadcast_to(self.roots, (len(rows), len(self.roots))).copy()
        which = np.arange(len(rows))[:, None]
        for _ in range(depth):
            told = rows[which, self.feature[at]]
            goes_left = (told <= self.threshold[at]) | (np.isnan(told) & self.missing_left[at])
            at = np.where(goes_left, self.left[at], self.right[at])
        sums = np.add.reduceat(self.value[at], self.trees[:-1], axis=1) + self.base
        return np.asarray(sums * LEAF_UNIT_MPS2)


def write_trees(table: QuantileTrees, file: Path) -> None:
    """Write a table, complete or not at all; raises OSError."""
    told = {"version": np.array(TABLE_VERSION)}
    for name, value in table._asdict().items():
        if name == "words":
            value = [f"{key}={text}" for key, text in sorted(value.items())]
        told[name] = np.array(value)
    with partial_file(file) as partial, zipfile.ZipFile(partial, "w") as archive:
        for name, value in told.items():
            data = io.BytesIO()
            np.save(data, value, allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=_FIRST_DAY)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data.getvalue())


def read_trees(file: Path) -> QuantileTrees:
    """Read a table; raises UserError, naming the file, for one that cannot be used."""
    try:
        found = _columns(file)
        version = int(found.pop("version"))
        if version != TABLE_VERSION:
            raise ValueError(f"version {version}; this foretwin reads version {TABLE_VERSION}")
        found["features"] = tuple(str(name) for name in found["features"])
        found["words"] = dict(map(_pair, found["words"]))
        table = QuantileTrees(**found)
        _check(table)
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile, EOFError) as error:
        raise UserError(f"{file}: no table of progress: {error}") from error
    return table


def _columns(file: Path) -> dict[str, Any]:
    """Return the columns in a table's file; raises ValueError for any other file.

    numpy would offer to unpickle a file that it does not know, which runs what is in it.
    """
    with file.open("rb") as data:
        if not zipfile.is_zipfile(data):
            raise ValueError("a table is what foretwin learn-progress --out FILE.npz writes")
        data.seek(0)
        with zipfile.ZipFile(data) as archive:
            found = {}
            for name in archive.namelist():
                with archive.open(name) as column:
                    found[name.removesuffix(".npy")] = _column(column)
    return found


def _column(file: IO[bytes]) -> Any:
    """Return one column of numbers or texts; raises ValueError for objects, and for no column."""
    try:
        return np.lib.format.read_array(file, allow_pickle=False)
    except ValueError as error:
        raise ValueError("it holds something else than columns of numbers and texts") from error


def _check(table: QuantileTrees) -> None:
    """Raise ValueError for a table on which a look-up could fail, or never end."""
    count, levels = len(table.value), len(table.levels)
    if not 0 < count <= MOST_NODES:
        raise ValueError(f"{count} nodes; 1 to {MOST_NODES}")
    nodes = [table.feature, table.threshold, table.left, table.right, table.missing_left]
    if any(len(column) != count for column in nodes):
        raise ValueError("columns of nodes differ in length")
    for name, column, most in (
        ("feature", table.feature, len(table.features)),
        ("left", table.left, count),
        ("right", table.right, count),
        ("roots", table.roots, count),
    ):
        if not ((column >= 0) & (column < most)).all():
            raise ValueError(f"{name}: places from 0 to below {most}")
    leaf = table.left == np.arange(count)
    deeper = (table.left > np.arange(count)) & (table.right > np.arange(count))
    if not (deeper | (leaf & (table.right == table.left))).all():
        raise ValueError("a node leads back")
    if len(table.trees) != levels + 1 or len(table.base) != levels or levels < 2:
        raise ValueError("trees and levels do not fit")
    if (
        table.trees[0] != 0
        or table.trees[-1] != len(table.roots)
        or (np.diff(table.trees) < 1).any()
    ):
        raise ValueError("trees: from 0 to the number of roots, at least one for each level")
    if table.shares.shape != (len(table.time_s), levels):
        raise ValueError("shares and levels do not fit")
    for name, rising in (("levels", table.levels[None]), ("shares", table.shares)):
        if not ((rising > 0.0) & (rising < 1.0)).all() or (np.diff(rising) <= 0.0).any():
            raise ValueError(f"{name} must rise between 0 and 1")
    if len(table.time_s) == 0 or (np.diff(table.time_s, prepend=0.0) <= 0.0).any():
        raise ValueError("time_s must rise from above 0")


def _pair(words: Any) -> tuple[str, str]:
    key, text = str(words).split("=", 1)
    return key, text
