"""One of several parts of a sweep, each swept by itself, wherever that is."""

from __future__ import annotations

import re
from typing import NamedTuple, Self

from foretwin.contracts.errors import UserError

_WORDS = re.compile(r"(\d{1,9})/(\d{1,9})", re.ASCII)


class Shard(NamedTuple):
    """The jobs of one of `of` shards: an equal stretch of the plan, so that each of them meets
    few Worlds; `number` counts from 0, as Slurm's arrays and Kubernetes' indexed jobs may."""

    number: int = 0
    of: int = 1

    @classmethod
    def named(cls, words: str) -> Self:
        """Return the shard that `i/n` names; raises UserError."""
        found = _WORDS.fullmatch(words)
        if found is None or not int(found[1]) < int(found[2]):
            raise UserError(f"--shard {words}: i/n, with i from 0 to n - 1, as 0/3, 1/3 and 2/3")
        return cls(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def numbers(self, jobs: int) -> range:
        """Return the numbers of its jobs, of so many in all."""
        return range(self.number * jobs // self.of, (self.number + 1) * jobs // self.of)


WHOLE = Shard()
"""A sweep that is not cut."""
