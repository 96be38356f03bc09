"""The commands that look at recordings: `convert` and `merge`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.told import CommandResult

if TYPE_CHECKING:
    from foretwin.telemetry.logs.convert import ConvertReport


def convert_log(
    source: Path, target: Path, *, to: str | None = None, declaration: Path | None = None
) -> CommandResult:
    """Convert a recorded drive and return what was kept and what was not.

    `to` is one of foretwin.telemetry.logs.convert.TARGETS, else the target's suffix tells.
    """
    from foretwin.telemetry.logs.convert import TARGETS, convert

    kind = next((one for one in TARGETS if one == to), None)
    if to is not None and kind is None:
        raise UserError(f"--to {to}: no kind of target; {one_of(to, TARGETS)}")
    if not source.exists():
        raise FileNotFoundError(f"recorded drive {source}: no such file or folder")
    if not target.parent.is_dir():
        raise UserError(f"{target}: folder {target.parent} does not exist")
    report = convert(source, target, declaration=declaration, to=kind)
    return CommandResult(_written(target, report), "\n".join(_lines(target, report)))


def _written(target: Path, report: ConvertReport) -> dict[str, object]:
    return {"file": target, "samples": report.counts, "left_out": report.skipped}


def _lines(target: Path, report: ConvertReport) -> list[str]:
    kept = ", ".join(f"{count} {name}" for name, count in sorted(report.counts.items()))
    lines = [f"{target}: {kept}"]
    if report.skipped:
        left = ", ".join(f"{count} {reason}" for reason, count in sorted(report.skipped.items()))
        lines.append(f"left out: {left}")
    return lines


def merge_logs(
    first: Path,
    second: Path,
    target: Path,
    *,
    declaration: Path | None = None,
    other_declaration: Path | None = None,
) -> CommandResult:
    """Put two recordings of one drive on the first's clock, write them as one, and return how."""
    from foretwin.telemetry.logs.clock_between import clock_between
    from foretwin.telemetry.logs.convert import target_of, write_log
    from foretwin.telemetry.logs.merge import together
    from foretwin.telemetry.logs.opening import open_log

    kind = target_of(target)
    ours = open_log(first, declaration=declaration)
    theirs = open_log(second, declaration=other_declaration)
    taken = [name for name in theirs.info.sends if name not in ours.info.sends]
    if not taken:
        raise UserError(
            f"{second}: has nothing that {first} lacks ({', '.join(theirs.info.sends)}); the order"
            " of the two says whose channels are kept"
        )
    clock = clock_between(ours, theirs)
    log = together(ours, theirs, stamp_ns=clock.first_from_second(ours.info.start_stamp_ns))
    report = write_log(
        log, target, kind=kind, read=((first, declaration), (second, other_declaration))
    )
    how = [clock.said(str(second), str(first)), f"taken from {second}: {', '.join(taken)}"]
    return CommandResult(
        {**_written(target, report), "taken": {str(second): taken}, "clock": clock._asdict()},
        "\n".join([*how, *_lines(target, report)]),
    )
