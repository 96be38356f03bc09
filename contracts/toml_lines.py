"""On which line of a TOML text each key stands, for errors that name it.

The text is one that `tomllib` has read: nothing is checked here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

Place = tuple[str | int, ...]
"""Keys and indices from the top of a file to one of its values."""
_BLANK, _BARE_END = " \t\r\n", "=.]#,}{[ \t\r\n"


def lines_of(text: str) -> Mapping[Place, int]:
    """Return the line, from 1, of every key, table and item of a list, by its place."""
    scan = _Scan(text)
    with contextlib.suppress(IndexError):  # where the text ends inside a value
        scan.document()
    return scan.lines


def line_at(lines: Mapping[Place, int], place: Place) -> int | None:
    """Return the line of a place, else of the nearest one around it; None for the whole file."""
    while place:
        if place in lines:
            return lines[place]
        place = place[:-1]
    return None


class _Scan:
    """A walk through a text: where it is, and what it has passed."""

    def __init__(self, text: str) -> None:
        self.text = text + "\n"
        self.at = 0
        self.lines: dict[Place, int] = {}
        self._entries: dict[Place, int] = {}
        """How many tables each array of tables has so far."""

    def document(self) -> None:
        """Walk through all tables and keys."""
        table: Place = ()
        while self._skip():
            if self.text.startswith("[[", self.at):
                table = self._header("[[")
            elif self.text[self.at] == "[":
                table = self._header("[")
            else:
                self._pair(table)

    def _header(self, opening: str) -> Place:
        line = self._line()
        self.at += len(opening)
        *around, last = self._keys()
        self.at = self.text.index("]" * len(opening), self.at) + len(opening)
        table: Place = ()
        for key in around:
            table = (*table, key)
            self.lines.setdefault(table, line)
            table = self._newest(table)
        table = (*table, last)
        if opening == "[[":
            self._entries[table] = self._entries.get(table, -1) + 1
        self.lines.setdefault(table, line)
        table = self._newest(table)
        self.lines.setdefault(table, line)
        return table

    def _newest(self, table: Place) -> Place:
        return (*table, self._entries[table]) if table in self._entries else table

    def _pair(self, table: Place) -> None:
        line = self._line()
        place = table
        for key in self._keys():
            place = (*place, key)
            self.lines.setdefault(place, line)
        self.at = self.text.index("=", self.at) + 1
        self._value(place)

    def _value(self, place: Place) -> None:
        self._skip()
        match self.text[self.at]:
            case "[":
                self.at += 1
                index = 0
                while self._skip() and self.text[self.at] != "]":
                    if self.text[self.at] == ",":
                        self.at += 1
                        continue
                    self.lines.setdefault((*place, index), self._line())
                    self._value((*place, index))
                    index += 1
                self.at += 1
            case "{":
                self.at += 1
                while self._skip() and self.text[self.at] != "}":
                    if self.text[self.at] == ",":
                        self.at += 1
                        continue
                    self._pair(place)
                self.at += 1
            case '"' | "'":
                self._quoted()
            case _:
                while self.text[self.at] not in ",]}#\n":
                    self.at += 1

    def _keys(self) -> list[str]:
        """Return the parts of a dotted key."""
        found = []
        while True:
            self._skip()
            if self.text[self.at] in "\"'":
                found.append(self._quoted())
            else:
                start = self.at
                while self.text[self.at] not in _BARE_END:
                    self.at += 1
                found.append(self.text[start : self.at])
            self._skip()
            if self.text[self.at] != ".":
                return found
            self.at += 1

    def _quoted(self) -> str:
        """Pass a text in quotes; escapes in it stay as they are written."""
        mark = self.text[self.at]
        if self.text.startswith(3 * mark, self.at):
            mark *= 3
        start = self.at = self.at + len(mark)
        while not self.text.startswith(mark, self.at):
            self.at += 2 if mark[0] == '"' and self.text[self.at] == "\\" else 1
            if self.at >= len(self.text):
                raise IndexError
        end = self.at
        self.at += len(mark)
        while len(mark) == 3 and self.text[self.at] == mark[0]:  # '"""a"""""' ends in two quotes
            self.at += 1
        return self.text[start:end]

    def _skip(self) -> bool:
        """Pass blanks and comments; returns whether anything is left."""
        while self.at < len(self.text):
            if self.text[self.at] == "#":
                self.at = self.text.index("\n", self.at)
            elif self.text[self.at] in _BLANK:
                self.at += 1
            else:
                return True
        return False

    def _line(self) -> int:
        return self.text.count("\n", 0, self.at) + 1
