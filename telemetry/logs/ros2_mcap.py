"""Reader of MCAP files: our own, which say all in their metadata, and those of other programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec

from contracts import drive
from contracts.frames import LocalFrame
from telemetry.logs.foreign_mcap import WINDOW_NS, open_foreign, time_base_of
from telemetry.logs.log import FILE_CUT_SHORT, VALUE_NOT_FINITE, Declared, Log, LogError, Sample
from telemetry.logs.mcap_records import Contents, read_contents, records
from telemetry.logs.merge import reordered
from telemetry.mcap_file import FORMAT_METADATA, FRAME_METADATA, INFO_METADATA
from telemetry.ros_messages import TOPIC_PREFIX, message_from


def open_mcap(path: Path) -> Log:
    """Open an MCAP file; raises LogError where it is none or holds no positions."""
    contents = read_contents(path)
    if FORMAT_METADATA in contents.metadata:
        return _open_own(path, contents)
    return open_foreign(path, contents, _frame(contents))


def read_drive(path: Path) -> Iterator[Sample]:
    """Yield every message of our own file by log time, the vehicle's states and `end` included.

    Unlike `open_mcap(path).samples()` nothing is refused. Raises LogError for another's file.
    """
    contents = read_contents(path)
    if FORMAT_METADATA not in contents.metadata:
        raise LogError(f"{path}: not written by foretwin: no metadata {FORMAT_METADATA!r}")
    frame = _frame(contents)
    for record in records(path, contents, set(contents.counts)):
        sample = message_from(record.topic, record.data, frame)
        if sample is not None:
            yield sample


def _frame(contents: Contents) -> LocalFrame | None:
    told = contents.metadata.get(FRAME_METADATA)
    return None if told is None else msgspec.json.decode(told["json"], type=LocalFrame)


def _open_own(path: Path, contents: Contents) -> Log:
    frame = _frame(contents)
    topics = {
        topic
        for topic in contents.counts
        if topic not in (f"{TOPIC_PREFIX}end", f"{TOPIC_PREFIX}state_json")
    }
    channels = sorted({name for topic in topics if (name := _own_channel(topic))})
    if not channels:
        raise LogError(f"{path}: holds no telemetry")
    told = contents.metadata.get(INFO_METADATA)
    if told is not None:
        info = msgspec.json.decode(told["json"], type=drive.VehicleInfo)
        info = msgspec.structs.replace(info, end_stamp_ns=contents.last_ns)
    else:
        info = drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base_of(contents.first_ns),
            start_stamp_ns=contents.first_ns,
            end_stamp_ns=contents.last_ns,
            source=path.name,
            sends=tuple(channels),
        )

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if contents.cut_short:
            skipped[FILE_CUT_SHORT] += 1
        samples = _own_samples(path, contents, topics, frame, skipped)
        return samples if contents.indexed else reordered(samples, window_ns=WINDOW_NS)

    return Log(
        info=info,
        declared=Declared(
            units="degrees, m/s, rad, m/s²",
            frame="WGS84",
            time_base=info.time_base,
            reference_point=info.reference_point,
        ),
        read=read,
    )


def _own_channel(topic: str) -> str | None:
    """Return the channel that a topic of ours carries; None for views."""
    name = topic.removeprefix(TOPIC_PREFIX)
    if topic == name or name in ("control", "state", "steering_report"):
        return None
    return name.removesuffix("_json")


def _own_samples(
    path: Path,
    contents: Contents,
    topics: set[str],
    frame: LocalFrame | None,
    skipped: Counter[str],
) -> Iterator[Sample]:
    for record in records(path, contents, topics):
        try:
            sample = message_from(record.topic, record.data, frame)
        except msgspec.ValidationError:
            # JSON has no NaN: it stands as null where a number belongs.
            skipped[VALUE_NOT_FINITE] += 1
            continue
        if sample is not None:
            yield sample
