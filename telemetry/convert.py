"""Turning a recorded drive of any kind into one MCAP file."""

from __future__ import annotations

from pathlib import Path

import msgspec

from telemetry.logs import LogError, open_log
from telemetry.mcap_file import create


class ConvertReport(msgspec.Struct, frozen=True, kw_only=True):
    """What was written: samples by channel; and what was refused, by reason."""

    counts: dict[str, int]
    skipped: dict[str, int]


def convert(source: Path, target: Path, *, declaration: Path | None = None) -> ConvertReport:
    """Write the log at `source` to `target`, complete or not at all.

    Raises what `telemetry.logs.open_log` raises, LogError where no sample is valid or the target
    is the source, and OSError where `target` cannot be written.
    """
    source, target = Path(source), Path(target)
    log = open_log(source, declaration=declaration)
    if target.exists() and target.samefile(source):
        raise LogError(f"{target}: is the log itself; name another target")
    partial = target.with_name(target.name + ".partial")
    writer = create(partial, info=log.info)
    try:
        with writer:
            for channel, message in log.samples():
                writer.add(channel, message)
        if writer.error is not None:
            raise writer.error
        if not writer.counts:
            told = ", ".join(f"{count} x {reason}" for reason, count in log.skipped.items())
            raise LogError(f"{source}: holds no valid sample ({told or 'it is empty'})")
        partial.replace(target)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    return ConvertReport(counts=dict(writer.counts), skipped=dict(log.skipped))
