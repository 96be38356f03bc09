"""Writes many Worlds into a folder, with a progress bar, and says what became of them."""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from foretwin.contracts.terminal import say
from foretwin.contracts.world import World
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.world_gen.junctions.intersections import Junction

if TYPE_CHECKING:
    from foretwin.world_gen.report.report import WorldReport

FAILURES_FILE = "failures.txt"
SOME_FAILED = 3
_SHOWN_KINDS = 20


def write_each(
    junctions: Sequence[Junction],
    build: Callable[[Junction], World],
    write: Callable[[World, Path], None],
    *,
    folder: Path,
    suffix: str,
    attribution: str,
    report: bool = False,
) -> CommandResult:
    """Write one file per junction into a folder, made if need be; its code is 3 if some failed.

    What goes wrong with one junction is said in a line and in the failures file of the folder,
    and does not stop the others.
    """
    from foretwin.world_gen.report.report import note_kind

    folder.mkdir(parents=True, exist_ok=True)
    kinds: Counter[str] = Counter()
    failures: list[str] = []
    with progress_bar(len(junctions), "Worlds") as (advance, say):
        for junction in junctions:
            name = junction.summary.id
            path = folder / f"{_file_name(name)}{suffix}"
            try:
                world = build(junction)
                write(world, path)
                if report:
                    write_report(world, path)
                kinds.update({note_kind(note) for note in world.notes})
            except Exception as error:  # one bad junction never stops the rest
                path.unlink(missing_ok=True)
                failures.append(f"{name}: {type(error).__name__}: {' '.join(str(error).split())}")
                say(f"failed: {failures[-1]}")
            advance(name)
    return _summary(len(junctions), failures, kinds, folder, attribution)


def write_report(world: World, path: Path) -> WorldReport:
    """Write what was tagged, inferred and a default beside a World's file; returns it."""
    from foretwin.world_gen.report.report import report_of
    from foretwin.world_gen.report.text import as_markdown

    report = report_of(world)
    for ending, text in ((".report.md", as_markdown(report)), (".report.json", report.as_json())):
        path.with_name(path.name + ending).write_text(text, encoding="utf-8")
    return report


def _summary(
    count: int, failures: list[str], kinds: Counter[str], folder: Path, attribution: str
) -> CommandResult:
    listed = folder / FAILURES_FILE
    listed.unlink(missing_ok=True)
    written = f"{folder}: {count - len(failures)} of {count} Worlds written. {attribution}"
    body = {
        "folder": folder,
        "written": count - len(failures),
        "failures": failures,
        "notes": kinds,
        "attribution": attribution,
    }
    if failures:
        _list_failures(failures, listed)
    words = "\n".join([written, *kind_lines(kinds)])
    return CommandResult(body, words, SOME_FAILED if failures else 0)


def kind_lines(kinds: Counter[str]) -> list[str]:
    """Return a line for each of the commonest kinds of notes, with how many there are."""
    lines = [f"  {count:6d}  {kind}" for kind, count in kinds.most_common(_SHOWN_KINDS)]
    if len(kinds) > _SHOWN_KINDS:
        lines.append(f"  and {len(kinds) - _SHOWN_KINDS} more kinds of notes")
    return lines


def _list_failures(failures: list[str], listed: Path) -> None:
    try:
        listed.write_text("\n".join(failures) + "\n", encoding="utf-8")
    except OSError as error:  # a full disk: the first of them is told here
        listed.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            listed.parent.rmdir()
        say(
            f"{len(failures)} failed, and {listed} cannot be written: {error.strerror}; the first: "
            f"{failures[0]}",
            error=True,
        )
        return
    say(f"{len(failures)} failed: {listed}", error=True)


def _file_name(junction_id: str) -> str:
    return re.sub(r"[^\w.+-]+", "_", junction_id)
