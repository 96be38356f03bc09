"""What a monitor of the drawn junction shows: its rows by path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from foretwin.viewer.monitor import Monitor
from foretwin.viewer.rows import Row
from tests.viewer import scene


def monitor_of(
    load_world: Any = lambda _id: scene.junction(), lot: Sequence[Row] = (), **settings: Any
) -> Monitor:
    return Monitor(
        drive_frame=scene.DRIVE_FRAME,
        find_start=lambda _first: scene.START_NS,
        title="t",
        load_world=load_world,
        lot=lot,
        **settings,
    )


@dataclass
class Shown:
    """Rows by path, the last of each."""

    rows: list[Row]

    def __getitem__(self, path: str) -> Any:
        return next(row for row in reversed(self.rows) if row.path == path).components

    @property
    def paths(self) -> list[str]:
        return [row.path for row in self.rows]


def text_of(document: Any) -> str:
    """Return the text of a document."""
    (text,) = document.text.as_arrow_array().to_pylist()
    return str(text)
