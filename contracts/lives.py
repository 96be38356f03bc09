"""Which life of a process counts, where one that has ended is still heard of beside its successor.

A router tells nothing of a token that somebody else holds already: were it the same for each life,
a process that is there again before its connection of before is missed would be heard of no more.
"""

from __future__ import annotations

import secrets
import time
from typing import NamedTuple

_WORDS = 6
"""Of a liveliness key, see foretwin.contracts.keys.ALIVE_KEY; what follows is the life."""


def new_life() -> str:
    """Return a word for the life of a process that begins: lives of one machine sort by it."""
    return f"{time.monotonic_ns():016x}-{secrets.token_hex(4)}"


def key_of_life(alive_key: str, life: str) -> str:
    """Return the liveliness token of one life of a process, or of all lives with `**`."""
    return f"{alive_key}/{life}"


def life_of_key(full_key: str) -> tuple[str, str]:
    """Return the liveliness key of a process, and which life of it a token is of."""
    words = full_key.split("/")
    return "/".join(words[:_WORDS]), "/".join(words[_WORDS:])


class Word(NamedTuple):
    """That a process is there, or no more, under its liveliness key."""

    alive_key: str
    up: bool


class Lives:
    """Makes of the tokens of lives what is to be told of their processes.

    The life that began last counts; one of before it comes and goes untold. Clocks of machines
    differ: where a process has moved to one that was started later, its new life counts once the
    old one has ended.
    """

    def __init__(self) -> None:
        self._living: dict[str, frozenset[str]] = {}

    def take(self, full_key: str, *, up: bool) -> Word | None:
        """Return what a token that came or went says of its process, None where nothing."""
        alive_key, life = life_of_key(full_key)
        before = self._living.pop(alive_key, frozenset())
        after = before | {life} if up else before - {life}
        if after:
            self._living[alive_key] = after
        counted, counts = max(before, default=None), max(after, default=None)
        if counts == counted and not (up and life == counts):
            return None
        return Word(alive_key, counts is not None)
