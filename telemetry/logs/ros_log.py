"""Reader of MCAP files and bags: our own, which say all of themselves, and other programs'.

An MCAP file of ours tells vehicle and frame in metadata, a bag of ours in the String topics
INFO_TOPIC and FRAME_TOPIC, since bags of ROS 1 have no metadata.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.errors import one_line
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.segments import first_left, first_name, number_of, segments_of
from foretwin.telemetry.logs.foreign_ros import Decode, open_foreign, time_base_of
from foretwin.telemetry.logs.log import (
    FILE_CUT_SHORT,
    UNREADABLE_ROW,
    VALUE_NOT_FINITE,
    Log,
    LogError,
    Sample,
    check_undeclared,
)
from foretwin.telemetry.logs.map_origin import declared_of
from foretwin.telemetry.logs.mcap_records import read_metadata
from foretwin.telemetry.logs.merge import LATE_NS, in_parts, reordered
from foretwin.telemetry.logs.ros_bag import bag_recording
from foretwin.telemetry.logs.ros_recording import RosRecording, decoder, mcap_recording
from foretwin.telemetry.logs.write_mcap import (
    FORMAT_METADATA,
    FRAME_METADATA,
    INFO_METADATA,
    PART,
)
from foretwin.telemetry.ros_messages.foreign import UnusableError
from foretwin.telemetry.ros_messages.table import (
    FRAME_TOPIC,
    INFO_TOPIC,
    TOPIC_PREFIX,
    kind_of,
    message_of,
)

_Kind = TypeVar("_Kind")


def open_mcap(path: Path, *, declaration: Path | None = None) -> Log:
    """Open an MCAP file; raises LogError where it is none or holds no positions.

    The first part of a recording of ours (foretwin.contracts.segments), or the oldest that is left,
    is read with all others, as one drive. `declaration` is that of
    foretwin.telemetry.logs.map_origin, for files of other programs.
    """
    first = first_name(path)
    later = segments_of(first)[1:] if first_left(first) == path else []
    parts = [path, *(part for part in later if _is_part(first, part))]
    oldest = first_left(first) == path and (path == first or _is_part(first, path))
    missing = (number_of(first, parts[-1]) or 1) - len(parts) if oldest else 0
    if len(parts) > 1 or missing:
        check_undeclared(path, declaration, "foretwin's own recording")
        return _open_parts(parts, missing=missing)
    recording = mcap_recording(path)
    own = _metadata_of(recording)
    if FORMAT_METADATA in recording.contents.metadata:
        check_undeclared(path, declaration, "foretwin's own recording")
        return _open_own(recording, own)
    return open_foreign(recording, declared_of(path, declaration), frame=own.frame(path))


def _is_part(first: Path, path: Path) -> bool:
    """Whether a file says itself that it is the part that its name makes it."""
    try:
        said = read_metadata(path, FORMAT_METADATA).get(PART)
    except LogError:
        return False
    return said == str(number_of(first, path))


def _open_parts(parts: Sequence[Path], *, missing: int) -> Log:
    """Open the parts of a recording as one drive; a kill can leave one with nothing in it yet.

    How many are `missing`, before the first that is there or between them, is said.
    """
    recordings, logs, problems = [], [], []
    for part in parts:
        try:
            recordings.append(mcap_recording(part))
        except LogError as problem:
            problems.append(problem)
    said = [_metadata_of(recording) for recording in recordings]
    info_json = next((own.info_json for own in said if own.info_json is not None), None)
    for recording, own in zip(recordings, said, strict=True):
        try:
            logs.append(_open_own(recording, own._replace(info_json=info_json)))
        except LogError as problem:
            problems.append(problem)
    if not logs:
        raise problems[0]
    return in_parts(logs, unreadable=len(problems), missing=missing)


def _metadata_of(recording: RosRecording) -> _OwnMetadata:
    metadata = recording.contents.metadata
    return _OwnMetadata(
        *(metadata.get(name, {}).get("json") for name in (FRAME_METADATA, INFO_METADATA))
    )


def open_bag(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a ROS 1 or ROS 2 bag; raises LogError where it is none or holds no positions.

    `declaration` is as in open_mcap.
    """
    recording = bag_recording(path)
    known = {INFO_TOPIC, FRAME_TOPIC} & set(recording.contents.schemas)
    if not known:
        return open_foreign(recording, declared_of(path, declaration))
    check_undeclared(path, declaration, "foretwin's own recording")
    texts: dict[str, str] = {}
    decode = decoder(recording, known)
    for record in recording.chosen(known, Counter()):
        try:
            texts[record.topic] = decode(record).data
        except Exception as error:  # whatever rosbags raises over broken bytes
            what = f"{path}: its {record.topic} is damaged: {one_line(error)}"
            raise LogError(what) from None
    return _open_own(recording, _OwnMetadata(texts.get(FRAME_TOPIC), texts.get(INFO_TOPIC)))


class _OwnMetadata(NamedTuple):
    """What a file of ours says of itself, as JSON."""

    frame_json: str | None
    info_json: str | None

    def frame(self, path: Path) -> LocalFrame | None:
        return None if self.frame_json is None else _said(self.frame_json, LocalFrame, path)

    def info(self, path: Path) -> drive.VehicleInfo | None:
        return None if self.info_json is None else _said(self.info_json, drive.VehicleInfo, path)


def _said(text: str, kind: type[_Kind], path: Path) -> _Kind:
    """Return what a file of ours says of itself; LogError where that is damaged."""
    try:
        said: _Kind = admit(msgspec.json.decode(text, type=kind), where=str(path)).message
    except (msgspec.DecodeError, UnicodeError, Refused) as error:
        what = f"{path}: its {kind.__name__} is damaged: {one_line(error)}"
        raise LogError(what) from None
    return said


def _open_own(recording: RosRecording, own: _OwnMetadata) -> Log:
    path, contents = recording.path, recording.contents
    frame = own.frame(path)
    topics = {
        topic
        for topic in contents.counts
        if kind_of(topic) is not None
        and topic not in (f"{TOPIC_PREFIX}end", f"{TOPIC_PREFIX}state_json")
    }
    channels = sorted({topic.removeprefix(TOPIC_PREFIX).removesuffix("_json") for topic in topics})
    if not channels:
        raise LogError(f"{path}: holds no telemetry")
    info = own.info(path)
    if info is not None:
        # Another's recorder stamps with its own clock, which may be far from the vehicle's.
        end_ns = contents.last_ns if info.end_stamp_ns is None else info.end_stamp_ns
        info = msgspec.structs.replace(info, end_stamp_ns=min(end_ns, contents.last_ns))
    else:
        info = drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base_of(contents.first_ns),
            start_stamp_ns=contents.first_ns,
            end_stamp_ns=contents.last_ns,
            source=path.name,
            sends=tuple(channels),
        )

    decode = decoder(recording, topics)

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if contents.cut_short:
            skipped[FILE_CUT_SHORT] += 1
        samples = _own_samples(recording, topics, decode, frame, skipped)
        return samples if contents.indexed else reordered(samples, window_ns=LATE_NS)

    return Log(
        info=info,
        read=read,
    )


def _own_samples(
    recording: RosRecording,
    topics: set[str],
    decode: Decode,
    frame: LocalFrame | None,
    skipped: Counter[str],
) -> Iterator[Sample]:
    for record in recording.chosen(topics, skipped):
        try:
            yield message_of(record.topic, decode(record), frame)
        except msgspec.ValidationError:
            # JSON has no NaN: it stands as null where a number belongs.
            skipped[VALUE_NOT_FINITE] += 1
        except UnusableError as reason:
            skipped[str(reason)] += 1
        except Exception:  # whatever is raised over broken bytes
            skipped[UNREADABLE_ROW] += 1
