"""Damaged copies of whole files, read by every reader: read or refused in one line, soon, and
without filling the memory."""

from __future__ import annotations

import random
import resource
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.errors import UserError
from tests.damage import damaged

MOST_CPU_S = 20.0
"""To read or refuse one file of some kilobytes, on a machine that does other things too."""
MOST_GROWTH_MB = 600.0
"""Of the process over a whole run: libraries and caches take 200."""


class Finding(NamedTuple):
    """A file that a reader neither read nor refused in one line."""

    case: str
    what: str


def damage_one(original: Path, folder: Path, chance: random.Random) -> Path:
    """Return a damaged copy below `folder`; of a folder one of its files is damaged, or missing."""
    copy = folder / original.name
    if original.is_file():
        copy.write_bytes(damaged(original.read_bytes(), chance))
        for beside in original.parent.glob(f"{original.stem}.toml"):
            body = beside.read_bytes()
            whole = chance.random() < 0.7
            (folder / beside.name).write_bytes(body if whole else damaged(body, chance))
        return copy
    shutil.copytree(original, copy)
    victim = chance.choice(sorted(path for path in copy.rglob("*") if path.is_file()))
    if chance.random() < 0.1:
        victim.unlink()
    else:
        victim.write_bytes(damaged(victim.read_bytes(), chance))
    return copy


def read_damaged(
    originals: Sequence[Path],
    readers: Sequence[Callable[[Path], object]],
    *,
    folder: Path,
    count: int,
    seed: int,
) -> list[Finding]:
    """Damage and read `count` files; returns what went wrong, with the case that repeats it."""
    findings = []
    before_mb = _most_mb()
    for number in range(count):
        chance = random.Random(f"{seed}/{number}")
        original = originals[number % len(originals)]
        case = folder / str(number)
        case.mkdir()
        path = damage_one(original, case, chance)
        for reader in readers:
            name = f"seed {seed}, file {number}, {original.name}, {reader.__name__}"
            begun_s = time.process_time()
            wrong = _read(path, reader)
            if wrong:
                findings.append(Finding(name, wrong))
            if time.process_time() - begun_s > MOST_CPU_S:
                findings.append(Finding(name, f"took more than {MOST_CPU_S:g} s of CPU"))
        shutil.rmtree(case)
    if (growth_mb := _most_mb() - before_mb) > MOST_GROWTH_MB:
        findings.append(Finding(f"seed {seed}", f"memory grew by {growth_mb:.0f} MB"))
    return findings


def _read(path: Path, reader: Callable[[Path], object]) -> str:
    try:
        reader(path)
    except (UserError, FileNotFoundError) as refused:
        text = str(refused)
        return f"more than a line: {text[:300]!r}" if "\n" in text or len(text) > 2000 else ""
    except Exception as error:
        trace = error.__traceback__
        where = ""
        while trace is not None:
            code = trace.tb_frame.f_code
            if "/foretwin/" in code.co_filename or "/telemetry/" in code.co_filename:
                where = f"{Path(code.co_filename).name}:{trace.tb_lineno}"
            trace = trace.tb_next
        return f"{type(error).__name__} in {where}: {error}"[:300]
    return ""


def _most_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
