"""Turning a recorded drive of any kind into an MCAP file, a bag, or a CSV with its declaration."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import msgspec

from foretwin.contracts.new_folder import named_in_errors, trouble_with_folder
from foretwin.contracts.partial_file import PARTIAL, partial_file
from foretwin.telemetry.logs import Log, LogError, open_log

if TYPE_CHECKING:
    from foretwin.telemetry.logs.write_bag import BagWriter
    from foretwin.telemetry.logs.write_mcap import DriveWriter

Target = Literal["mcap", "ros2", "ros1", "csv"]
TARGETS: tuple[Target, ...] = get_args(Target)
NO_ROS_MESSAGE = "sample that no ROS message holds"
"""Such as one of after 2038-01-19, or a plan without points before any position."""
_BY_SUFFIX: dict[str, Target] = {".mcap": "mcap", ".bag": "ros1", ".csv": "csv", "": "ros2"}


class ConvertReport(msgspec.Struct, frozen=True, kw_only=True):
    """What was written: samples by channel; and what was refused or left out, by reason."""

    counts: dict[str, int]
    skipped: dict[str, int]


def target_of(path: Path) -> Target:
    """Return the kind of file that a name asks for; raises LogError for an unknown suffix."""
    kind = _BY_SUFFIX.get(path.suffix.lower())
    if kind is None:
        raise LogError(
            f"{path}: unknown suffix {path.suffix!r}; .mcap, .bag (ROS 1), .csv, or none for the"
            f" folder of a ROS 2 bag"
        )
    return kind


def convert(
    source: Path,
    target: Path,
    *,
    declaration: Path | None = None,
    to: Target | None = None,
) -> ConvertReport:
    """Write the log at `source` to `target`, complete or not at all.

    `to` is the kind of target, else its suffix tells; `declaration` is that of a CSV at `source`.
    The declaration of a CSV written is `TARGET.toml`. Raises what `telemetry.logs.open_log` raises,
    LogError where no sample is valid or what would be written is the source, its declaration, an
    existing folder or a declaration of somebody else, and OSError where `target` cannot be written.
    """
    source, target = Path(source), Path(target)
    kind = target_of(target) if to is None else to
    log = open_log(source, declaration=declaration)
    return write_log(log, target, kind=kind, read=((source, declaration),))


def write_log(
    log: Log, target: Path, *, kind: Target, read: Sequence[tuple[Path, Path | None]]
) -> ConvertReport:
    """Write a log to `target`, complete or not at all, and over nothing that it is `read` from.

    `read` are recordings, each with the declaration that was named for it. Raises what `convert`
    raises of the target.
    """
    written = (target, _declaration_of(target)) if kind == "csv" else (target,)
    for source, declaration in read:
        for file in written:
            _check_not_read(file, source, declaration or _declaration_of(source))
    if kind == "ros2" and target.exists():
        raise LogError(f"{target}: exists; name a folder that does not")
    if kind != "ros2" and target.is_dir():
        raise LogError(f"{target}: is a folder; name a file")
    if kind == "csv":
        _check_own(_declaration_of(target))
    if (trouble := trouble_with_folder(target.parent)) is not None:
        raise LogError(f"{target}: {trouble}")
    with named_in_errors(str(target)):
        counts, left_out = _WRITERS[kind](read[0][0], log, target)
    return ConvertReport(counts=dict(counts), skipped=dict(left_out + log.skipped))


def _declaration_of(path: Path) -> Path:
    return path.with_name(path.name + ".toml")


def _check_not_read(written: Path, source: Path, declared_in: Path) -> None:
    for read, what in ((source, "log itself"), (declared_in, "declaration of the log")):
        if written.exists() and read.exists() and written.samefile(read):
            raise LogError(f"{written}: is the {what}; name another target")


def _check_own(declaration: Path) -> None:
    """Refuse to replace a declaration that somebody wrote: only CSVs can be made again."""
    from foretwin.telemetry.logs.write_csv import DECLARATION_MARK

    mark = DECLARATION_MARK.encode()
    if declaration.is_file() and not declaration.read_bytes().startswith(mark):
        raise LogError(
            f"{declaration}: would be replaced, and does not begin with foretwin's mark as a "
            "declaration that `convert` wrote; move it, or name another target"
        )


def _check(source: Path, log: Log, counts: Counter[str], left_out: Counter[str]) -> None:
    if not counts:
        refused = log.skipped + left_out
        reasons = ", ".join(f"{count} x {reason}" for reason, count in refused.items())
        raise LogError(f"{source}: holds no valid sample ({reasons or 'it is empty'})")


def _to_mcap(source: Path, log: Log, target: Path) -> tuple[Counter[str], Counter[str]]:
    from foretwin.telemetry.logs.write_mcap import create

    with partial_file(target) as partial:
        with create(partial, info=log.info) as writer:
            left_out = _add_all(log, writer)
        if writer.error is not None:
            raise writer.error
        _check(source, log, writer.counts, left_out)
    return writer.counts, left_out


def _add_all(log: Log, writer: DriveWriter | BagWriter) -> Counter[str]:
    """Write all samples of a log; return what of them is left out."""
    left_out = Counter[str]()
    for channel, message in log.samples():
        try:
            writer.add(channel, message)
        except ValueError:
            left_out[NO_ROS_MESSAGE] += 1
    return left_out


def _to_ros1(source: Path, log: Log, target: Path) -> tuple[Counter[str], Counter[str]]:
    with partial_file(target) as partial:
        partial.unlink(missing_ok=True)
        return _to_bag(source, log, partial, ros1=True)


def _to_ros2(source: Path, log: Log, target: Path) -> tuple[Counter[str], Counter[str]]:
    # The folder's name is in the names of its files: it must be right from the beginning.
    around = target.with_name(target.name + PARTIAL)
    shutil.rmtree(around, ignore_errors=True)
    try:
        around.mkdir()
        written = _to_bag(source, log, around / target.name, ros1=False)
        (around / target.name).replace(target)
    finally:
        shutil.rmtree(around, ignore_errors=True)
    return written


def _to_bag(source: Path, log: Log, path: Path, *, ros1: bool) -> tuple[Counter[str], Counter[str]]:
    from foretwin.telemetry.logs.write_bag import BagWriter

    writer = BagWriter(path, ros1=ros1, info=log.info)
    try:
        left_out = _add_all(log, writer)
        _check(source, log, writer.counts, left_out)
    except BaseException:
        writer.abort()
        raise
    writer.close()
    return writer.counts, left_out


def _to_csv(source: Path, log: Log, target: Path) -> tuple[Counter[str], Counter[str]]:
    from foretwin.telemetry.logs.write_csv import write_csv

    with partial_file(_declaration_of(target)) as declaration, partial_file(target) as table:
        try:
            counts, left_out = write_csv(log.samples, log.info, table, declaration)
        except LogError:
            _check(source, log, Counter(channel for channel, _ in log.samples()), Counter())
            raise
    return counts, left_out


_WRITERS: dict[Target, Callable[[Path, Log, Path], tuple[Counter[str], Counter[str]]]] = {
    "mcap": _to_mcap,
    "ros1": _to_ros1,
    "ros2": _to_ros2,
    "csv": _to_csv,
}
