"""Reader of MCAP files and bags with ROS messages that other programs wrote.

Topics are chosen by message type, one topic per stream of telemetry.ros_foreign: the first type
that occurs, and among its topics the one with the most messages. The stamp is that of the header,
and the log time where that is 0. Plans and objects are read only where metadata `foretwin.frame`
tells the origin of their frame. Where static transforms lead from base_link to the frame of the
fixes, the antenna's place is theirs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from contracts import drive
from contracts.frames import LocalFrame
from telemetry.logs.log import FILE_CUT_SHORT, UNREADABLE_ROW, Declared, Log, LogError, Sample
from telemetry.logs.mcap_records import Contents, Record
from telemetry.logs.merge import reordered
from telemetry.logs.ros_recording import Recording, decoder
from telemetry.ros_foreign import FOREIGN, UnusableError, stamp_of
from telemetry.ros_parts import BASE_FRAME, TF
from telemetry.ros_status import StatusJoiner
from telemetry.ros_transforms import TransformTree

WINDOW_NS = 2_000_000_000
"""How late a message may lie in its file and still be put in order."""
_UTC_FROM_NS = 946_684_800_000_000_000
"""2000-01-01: clocks beyond it count from 1970, others from boot or start."""

Decode = Callable[[Record], Any]


def open_foreign(recording: Recording, frame: LocalFrame | None) -> Log:
    """Open a file of another program; `frame` is the frame of its plans, None where unknown.

    Raises LogError where it holds no positions, or definitions that cannot be read.
    """
    path, contents = recording.path, recording.contents
    topics = _choose_topics(contents)
    if "gnss" not in topics:
        kinds = sorted({schema.name for schema in contents.schemas.values()})
        raise LogError(
            f"{path}: no topic of type sensor_msgs/msg/NavSatFix, so no positions;"
            f" types: {', '.join(kinds) or 'none'}"
        )
    decode = decoder(recording, set(topics.values()))

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if contents.cut_short:
            skipped[FILE_CUT_SHORT] += 1
        samples = _foreign_samples(recording, set(topics.values()), decode, frame, skipped)
        return _joined(reordered(samples, window_ns=WINDOW_NS))

    # Header stamps differ from log times by the transport's delay, and at times by a whole epoch.
    lag_ns, antenna_frame = _first_fix(recording, topics["gnss"], decode)
    start_ns = contents.first_ns - lag_ns
    antenna_m = _antenna_m(recording, antenna_frame)
    channels = dict.fromkeys(_channel_of(contents, topic) for topic in topics.values())
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base_of(start_ns),
            start_stamp_ns=start_ns,
            end_stamp_ns=contents.last_ns - lag_ns,
            source=path.name,
            reference_point="antenna",
            body_from_antenna_m=antenna_m,
            sends=tuple(channels),
        ),
        declared=Declared(
            units="degrees, m/s, rad, m/s²; "
            + ", ".join(f"{stream} from {topic}" for stream, topic in topics.items()),
            frame="WGS84, body axes forward, left, up",
            time_base="stamp of the header, log time where it is 0",
            reference_point="antenna, place unknown"
            if antenna_m is None
            else "antenna, placed by static transforms",
        ),
        read=read,
    )


def time_base_of(stamp_ns: int) -> drive.TimeBase:
    """Guess the time base from one stamp."""
    return "utc" if stamp_ns > _UTC_FROM_NS else "log"


def _choose_topics(contents: Contents) -> dict[str, str]:
    chosen: dict[str, str] = {}
    for kind, how in FOREIGN.items():
        topics = [
            topic
            for topic, schema in contents.schemas.items()
            if schema.name == kind and contents.counts.get(topic, 0) > 0
        ]
        if topics and how.stream not in chosen:
            chosen[how.stream] = max(topics, key=lambda topic: (contents.counts[topic], topic))
    return chosen


def _channel_of(contents: Contents, topic: str) -> str:
    return FOREIGN[contents.schemas[topic].name].channel


def _first_fix(recording: Recording, topic: str, decode: Decode) -> tuple[int, str]:
    """Return how far the log time is ahead of the first readable fix's stamp, and its frame."""
    for record in recording.chosen({topic}, Counter()):
        try:
            ros = decode(record)
            lag_ns = record.log_time_ns - (stamp_of(ros) or record.log_time_ns)
            return lag_ns, str(ros.header.frame_id)
        except Exception:  # an unreadable message, counted when it is read
            continue
    return 0, ""


def _antenna_m(recording: Recording, antenna_frame: str) -> drive.Vector3 | None:
    schemas = recording.contents.schemas
    topics = {
        topic
        for topic, schema in schemas.items()
        if schema.name == TF and topic.endswith("tf_static")
    }
    if not topics or not antenna_frame:
        return None
    tree = TransformTree()
    try:
        decode = decoder(recording, topics)
        for record in recording.chosen(topics, Counter()):
            tree.add(decode(record))
    except Exception:  # a place that cannot be read is one that is not known
        return None
    return tree.place_of(antenna_frame, within=BASE_FRAME)


def _foreign_samples(
    recording: Recording,
    topics: set[str],
    decode: Decode,
    frame: LocalFrame | None,
    skipped: Counter[str],
) -> Iterator[Sample]:
    for record in recording.chosen(topics, skipped):
        how = FOREIGN[record.kind]
        try:
            ros = decode(record)
            messages = how.read(ros, stamp_of(ros) or record.log_time_ns, frame)
        except UnusableError as reason:
            skipped[str(reason)] += 1
        except Exception:  # whatever rosbags raises over broken bytes
            skipped[UNREADABLE_ROW] += 1
        else:
            for message in messages:
                yield how.channel, message


def _joined(samples: Iterator[Sample]) -> Iterator[Sample]:
    """Join the reports of a status; those of one stamp become one sample."""
    joiner = StatusJoiner()
    waiting: drive.VehicleStatus | None = None
    for channel, message in samples:
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if waiting is not None and stamp_ns != waiting.stamp_ns:
            yield "status", waiting
            waiting = None
        if isinstance(message, drive.VehicleStatus):
            waiting = joiner.join(message)
        else:
            yield channel, message
    if waiting is not None:
        yield "status", waiting
