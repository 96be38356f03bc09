"""`foretwin report`: what a run or a sweep foresaw and what came, as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.exit_codes import DONE, PARTLY
from foretwin.contracts.new_folder import named_in_errors
from foretwin.contracts.segments import DRIVE_FILE, first_left
from foretwin.orchestrator.commands.output import check_html_file, size_words
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.orchestrator.report.redaction import Redaction
from foretwin.orchestrator.report.write_report import write_report

if TYPE_CHECKING:
    from foretwin.sim_worker.analysis.two_drives.differences import Spread


class ReportWritten(msgspec.Struct, frozen=True, kw_only=True):
    """A report that was written: its file, the sentence of its first page, and of several runs the
    indicators over them."""

    file: str
    size_bytes: int
    verdict: str
    unread: tuple[str, ...] = ()
    """What there should be of the folders and is missing or could not be read."""
    indicators: msgspec.Struct | None = None


def report(
    folders: Sequence[Path],
    *,
    out: Path,
    redact: str | None = None,
    against: Path | None = None,
) -> CommandResult:
    """Write the report of a run; with `against`, another drive of its road, how far people differ
    stands beside the gap.

    Raises UserError or what errors of paths raise, before anything is written.
    """
    redaction = _redaction(redact)
    check_html_file(out, "--out", "a report")
    if against is not None and len(folders) != 1:
        raise UserError("--against goes with one run")
    people = [] if against is None else _people(folders[0], against)
    with named_in_errors(f"--out {out}"):
        out.parent.mkdir(parents=True, exist_ok=True)
        told = write_report(folders, out, people=people, redaction=redaction, progress=progress_bar)
    written = ReportWritten(
        file=str(out),
        size_bytes=out.stat().st_size,
        verdict=told.verdict,
        unread=told.unread,
        indicators=told.counted,
    )
    words = [written.verdict, f"wrote {written.file} ({size_words(written.size_bytes)})"]
    words += [f"left out: {one}" for one in written.unread]
    return CommandResult(written, "\n".join(words), PARTLY if written.unread else DONE)


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

    found = compare_logs(first_left(run / DRIVE_FILE), against)
    if found.one_drive:
        return []
    return [
        HumanRow(row.horizon_s, row.along.places, *map(_rms, (row.along, row.across, row.speed)))
        for row in found.difference.after
    ]


def _rms(one: Spread) -> float | None:
    return one.rms if one.places else None
