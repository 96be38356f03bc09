"""Which life of a process counts, where one that has ended is still heard of beside its successor.

A router tells nothing of a token that somebody else holds already: were it the same for each life,
a process that is there again before its connection of before is missed would be heard of no more.
"""

from __future__ import annotations

import secrets
import time

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


class Lives:
    """Makes of the tokens of lives what is to be told of their processes.

    The life that began last counts; one of before it comes and goes untold.
    """

    def __init__(self) -> None:
        self._counts: dict[str, str] = {}

    def take(self, full_key: str, *, up: bool) -> str | None:
        """Return the liveliness key of the process that came or went with a token, None where it
        did not."""
        alive_key, life = life_of_key(full_key)
        last = self._counts.get(alive_key)
        if up and (last is None or life >= last):
            self._counts[alive_key] = life
        elif not up and life == last:
            del self._counts[alive_key]
        else:
            return None
        return alive_key
