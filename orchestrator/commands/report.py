"""`foretwin report`: what a run or a sweep foresaw and what came, as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from foretwin.contracts.errors import UserError
from foretwin.contracts.new_folder import named_in_errors, trouble_with_folder
from foretwin.contracts.segments import DRIVE_FILE
from foretwin.contracts.terminal import say
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.orchestrator.report.redaction import Redaction
from foretwin.orchestrator.report.write_report import write_report

if TYPE_CHECKING:
    from foretwin.sim_worker.analysis.two_drives.differences import Spread

_SUFFIXES = (".html", ".htm")


def report(
    folders: Sequence[Path], *, out: Path, redact: str | None = None, against: Path | None = None
) -> None:
    """Write the report of a run; with `against`, another drive of its road, how far people differ
    stands beside the gap.

    Raises UserError or what errors of paths raise, before anything is written.
    """
    redaction = _redaction(redact)
    if out.suffix.lower() not in _SUFFIXES:
        raise UserError(f"--out {out}: a report is an HTML file, such as {out.stem}.html")
    if out.is_dir():
        raise UserError(f"--out {out}: is a folder")
    if (trouble := trouble_with_folder(out.parent)) is not None:
        raise UserError(f"--out {out}: {trouble}")
    if against is not None and len(folders) != 1:
        raise UserError("--against goes with one run")
    people = [] if against is None else _people(folders[0], against)
    with named_in_errors(f"--out {out}"):
        out.parent.mkdir(parents=True, exist_ok=True)
        told = write_report(folders, out, people=people, redaction=redaction)
    say(told.verdict)
    say(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")


def _redaction(word: str | None) -> Redaction | None:
    known: tuple[Redaction, ...] = get_args(Redaction)
    if word is None:
        return None
    for one in known:
        if word == one:
            return one
    raise UserError(f"--redact {word}: {' or '.join(known)}")


def _people(run: Path, against: Path) -> list[HumanRow]:
    from foretwin.orchestrator.commands.compare import compare_logs

    found = compare_logs(run / DRIVE_FILE, against)
    return [
        HumanRow(row.horizon_s, row.along.places, *map(_rms, (row.along, row.across, row.speed)))
        for row in found.difference.after
    ]


def _rms(one: Spread) -> float | None:
    return one.rms if one.places else None
