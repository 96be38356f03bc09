"""What a drive left, and what had befallen it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tests.chaos.faults import Case
from tests.chaos.injection import Done


class Left(NamedTuple):
    """What a drive left, and what had befallen it."""

    case: Case
    run: Path
    code: int
    done: list[Done]
    screen: str
    temporary: tuple[Path, ...]
    """Folders where nothing may stay."""
    syncs: Path
    scratch: Path
    recovered: tuple[int, str] | None
    """Exit code and screen of `foretwin recover`, where the drive's record could not be written."""
    begun_ns: int
    lost_s: dict[int, float]
    """Seconds of telemetry that a fault took along, by its number; found out when looked at."""

    def befell(self, *kinds: str, what: tuple[str, ...] = ()) -> list[Done]:
        """Return the faults of these kinds of processes, and of these faults."""
        return [
            one
            for one in self.done
            if (not kinds or one.kind in kinds) and (not what or one.fault.what in what)
        ]
