"""How work that takes long tells how far it is; whether anybody shows it is its caller's choice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

Progress = Callable[
    [int, str], AbstractContextManager[tuple[Callable[..., None], Callable[[str], None]]]
]
"""Given how many there are of what; in it, what is called first names each that is done, or `by`
so many, and what is called second says a line."""


@contextmanager
def untold(total: int, what: str) -> Iterator[tuple[Callable[..., None], Callable[[str], None]]]:
    """Be a Progress that nobody looks at."""
    yield (lambda name, *, by=1: None), (lambda text: None)
