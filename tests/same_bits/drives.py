"""Drives in lock step: what every job of every round came to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.same_bits.comparison import Digests, Section
from tests.same_bits.sides import Side, SideError, on_both

BERLIN_MAP = "osm-berlin-mitte/berlin-mitte.osm"
BERLIN_LOG = "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt"
QUICK_TOWN = ("--end", "9")
QUICK_BERLIN = ("--start", "28", "--end", "42")
"""Towards a junction, and over it: with road users, and with collisions."""
# Results do not depend on the number of workers: one on each side, as both sides drive at once.
_LOCK_STEP = ("--speed", "max", "--view", "none", "--tuning", "off", "--workers", "1")


def compare_drives(
    sides: tuple[Side, Side], *, data: Path | None, quick: bool, seed: int
) -> list[Section]:
    """Return the jobs of a drive through the drawn town, and with data of the one in Berlin."""
    town = ("--seed", str(seed), *(QUICK_TOWN if quick else ()))
    sections = [_section("town", sides, town)]
    if data is not None:
        berlin = ("--map", str(data / BERLIN_MAP), "--log", str(data / BERLIN_LOG),
                  "--route", "from-log", "--seed", str(seed))  # fmt: skip
        sections.append(_section("berlin", sides, (*berlin, *(QUICK_BERLIN if quick else ()))))
    return sections


def _section(name: str, sides: tuple[Side, Side], arguments: Sequence[str]) -> Section:
    return Section(
        f"drive {name}: jobs", *on_both(sides, lambda side: drive(side, name, arguments))
    )


def drive(side: Side, name: str, arguments: Sequence[str]) -> Digests:
    """Drive to the end; returns what every job came to, by round, job, World and variants."""
    lines = side.run(
        f"drive-{name}", "drive", *_LOCK_STEP, *arguments,
        "--out", str(side.scratch / f"runs-{name}"), watched="run_job",
    )  # fmt: skip
    jobs: dict[str, dict[str, str]] = {}
    for line in lines:
        if jobs.setdefault(line.key, line.parts) != line.parts:
            raise SideError(f"{side.name}: drive {name}: one job came to two results: {line.key}")
    return jobs
