"""What many drives came to: each fault with what followed, kept in a file, and a table of them."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import msgspec


class Consequence(NamedTuple):
    """One fault, and what followed for the drive that it befell among others."""

    what: str
    kind: str
    words: str
    code: int
    lost_s: float | None
    """Seconds of telemetry that it took along, where that can be told."""
    back_s: float | None
    """After how long the process was there again, where it had died."""

    def __str__(self) -> str:
        lost = f", {self.lost_s:.2f} s lost" if self.lost_s else ""
        back = f", back after {self.back_s:.1f} s" if self.back_s is not None else ""
        return f"{self.words}{lost}{back}"


class DriveLine(msgspec.Struct, frozen=True, kw_only=True):
    """One drive as it stands in the file of a seed."""

    number: int
    kind: str
    revision: str
    code: int
    wall_s: float
    done: list[Consequence]
    skipped: list[str]
    wrong: list[str]


def keep(file: Path, line: DriveLine) -> None:
    """Add one drive to the file of its seed."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("ab") as opened:
        opened.write(msgspec.json.encode(line) + b"\n")


def kept(file: Path) -> dict[int, DriveLine]:
    """Return the drives of a seed by their number, of each the last that was played."""
    if not file.exists():
        return {}
    lines = (line for line in file.read_text(encoding="utf-8").splitlines() if line)
    drives = [msgspec.convert(json.loads(line), DriveLine) for line in lines]
    return {one.number: one for one in drives}


def table_of(drives: Iterable[DriveLine]) -> str:
    """Return a table of all faults by what and whom: how often, and what followed."""
    drives = list(drives)
    cells: dict[tuple[str, str], list[tuple[Consequence, bool]]] = defaultdict(list)
    for drive in drives:
        for one in drive.done:
            cells[one.what, one.kind].append((one, bool(drive.wrong)))
    lines = [
        f"{'fault':<11}{'of':<14}{'times':>6}  {'drives ended':<34}{'in failed':>9}"
        f"{'lost s':>8}{'back s':>8}"
    ]
    for (what, kind), held in sorted(cells.items()):
        codes = defaultdict[int, int](int)
        for one, _ in held:
            codes[one.code] += 1
        ends = ", ".join(f"{code}: {count}" for code, count in sorted(codes.items()))
        lost = _worst(one.lost_s for one, _ in held)
        back = _worst(one.back_s for one, _ in held)
        failed = sum(failed for _, failed in held)
        lines.append(f"{what:<11}{kind:<14}{len(held):>6}  {ends:<34}{failed:>9}{lost:>8}{back:>8}")
    skipped = Counter(words for drive in drives for words in drive.skipped)
    if skipped:
        lines.append(f"not possible at the time: {dict(sorted(skipped.items()))}")
    faults = sum(len(drive.done) for drive in drives)
    failed = [drive.number for drive in drives if drive.wrong]
    taken_s = sum(drive.wall_s for drive in drives)
    of_them = f"failed: {failed}" if failed else "none of them failed"
    revisions = ", ".join(dict.fromkeys(drive.revision for drive in drives))
    summary = f"{faults} faults in {len(drives)} drives ({revisions}), {of_them}; {taken_s:.0f} s"
    return "\n".join([*lines, summary])


def _worst(values: Iterable[float | None]) -> str:
    found = [one for one in values if one is not None]
    return f"{max(found):.2f}" if found else "-"
