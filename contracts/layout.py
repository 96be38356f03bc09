"""How the viewer is laid out: columns of rows of views, read from small TOML files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import MissingFileError, UserError
from foretwin.contracts.toml_file import parse_toml, toml_text

LayoutName = Literal["drive", "identify", "gap", "sweep"]
LAYOUTS: tuple[str, ...] = get_args(LayoutName)
"""Those that come along, as files below `LAYOUT_FILES`."""
LAYOUT_FILES = Path(__file__).parent / "layouts"
_Space = Literal["intersection", "chase", "map"]
_Text = Literal["status", "legend", "futures", "verdict", "parameters", "events"]
_Process = Literal["workers", "worker_speed", "worker_memory", "how_sure"]
_TwinGap = Literal["position_gap", "heading_gap", "speed_gap", "correction"]
_ModelGap = Literal["across_after_2_s", "along_after_2_s", "heading_after_2_s"]
_Forecast = Literal["forecast", "short_forecast", "plan", "engines", "lot"]
_Parameter = Literal[
    "steering_ratio", "steering_offset", "steering_delay", "drive_gain", "brake_gain"
]
ViewName = Literal[_Space, _Text, _Process, _TwinGap, _ModelGap, _Forecast, _Parameter]
"""What a layout can hold."""
VIEWS: tuple[str, ...] = tuple(get_args(ViewName))


class LayoutRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Views of one row: behind tabs, or beside each other."""

    share: float = 1.0
    """Its part of the column's height, among those of the other rows."""
    tabs: tuple[ViewName, ...] = ()
    """Views of which one is seen; the first one is open."""
    beside: tuple[ViewName, ...] = ()
    """Views that are seen all, from left to right."""


class LayoutColumn(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A column of the window."""

    share: float = 1.0
    """Its part of the width, among those of the other columns."""
    rows: tuple[LayoutRow, ...]
    """From top to bottom."""


class Layout(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A layout of the viewer."""

    purpose: str = ""
    """What one looks at with it."""
    columns: tuple[LayoutColumn, ...]
    """From left to right."""

    def trouble(self) -> str | None:
        """Return what is wrong with it, None where nothing is."""
        rows = [row for column in self.columns for row in column.rows]
        if not rows:
            return "holds no row of views"
        if any(bool(row.tabs) == bool(row.beside) for row in rows):
            return "each row needs either tabs = [...] or beside = [...]"
        shares = [column.share for column in self.columns] + [row.share for row in rows]
        if any(not 0.0 < share <= 1000.0 for share in shares):
            return "each share is above 0, at most 1000"
        return None

    def opened_at(self, *views: ViewName) -> Layout:
        """Return the layout with these views open where they stand behind a tab."""

        def opened(row: LayoutRow) -> LayoutRow:
            first = [view for view in views if view in row.tabs]
            tabs = (*first, *(view for view in row.tabs if view not in first))
            return msgspec.structs.replace(row, tabs=tabs)

        columns = tuple(
            msgspec.structs.replace(column, rows=tuple(opened(row) for row in column.rows))
            for column in self.columns
        )
        return msgspec.structs.replace(self, columns=columns)


def read_layout(name: str) -> Layout:
    """Return a layout that comes along, or that of a TOML file.

    Raises UserError, in one line, where there is none or where it cannot be used.
    """
    file = LAYOUT_FILES / f"{name}.toml" if name in LAYOUTS else Path(name)
    if not file.is_file():
        known = one_of(name, LAYOUTS)
        raise MissingFileError(f"--layout {name}: no such file; {known}, or a TOML file")
    layout = parse_toml(toml_text(file, "--layout"), f"--layout {name}").convert(Layout)
    if (trouble := layout.trouble()) is not None:
        raise UserError(f"--layout {name}: {trouble}")
    return layout
