"""Reader of MCAP files and bags with ROS messages that other programs wrote.

Topics are chosen by message type, one topic per stream of `ros_messages.foreign`: the first type
that occurs, and among its topics the one with the most messages. The stamp is that of the header,
and the log time where that is 0; what is ahead of the positions' clock is left out. Plans and
objects are read only where metadata `foretwin.frame` or a declaration tells the origin of their
frame. Where static transforms lead from base_link to the frame of the fixes, the antenna's place is
theirs; so are an inertial unit's axes (mountings.py). Without any fixes an Odometry in `map` gives
positions and headings, where that frame is placed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any, NamedTuple

from foretwin.contracts import drive
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.logs.fix_clock import OTHER_CLOCK, FixClock
from foretwin.telemetry.logs.log import FILE_CUT_SHORT, UNREADABLE_ROW, Log, LogError, Sample
from foretwin.telemetry.logs.map_origin import RecordingDeclaration
from foretwin.telemetry.logs.mcap_records import Contents, Record
from foretwin.telemetry.logs.merge import WINDOW_NS, reordered
from foretwin.telemetry.logs.mountings import (
    NOT_UPRIGHT,
    ImuMounting,
    imu_mounting,
    static_tree,
)
from foretwin.telemetry.logs.ros_recording import RosRecording, decoder
from foretwin.telemetry.logs.speed_topics import not_of_the_body, of_other_bodies
from foretwin.telemetry.ros_messages.ackermann import (
    NO_ACCELERATION,
    AckermannCommands,
    AckermannTarget,
)
from foretwin.telemetry.ros_messages.foreign import (
    FOREIGN,
    POSE,
    Foreign,
    UnusableError,
    channel_of,
    stamp_of,
)
from foretwin.telemetry.ros_messages.odometry import is_of_base, of_base
from foretwin.telemetry.ros_messages.parts import BASE_FRAME, ODOMETRY
from foretwin.telemetry.ros_messages.status import StatusJoiner, StatusPart
from foretwin.telemetry.ros_messages.transforms import TransformTree

_UTC_FROM_NS = 946_684_800_000_000_000
"""2000-01-01: clocks beyond it count from 1970, others from boot or start."""

Decode = Callable[[Record], Any]


def open_foreign(
    recording: RosRecording, declared: RecordingDeclaration, *, frame: LocalFrame | None = None
) -> Log:
    """Open a file of another program; `frame` is that of its plans and objects.

    Without it that of `declared` counts. Raises LogError where the file holds no positions, or
    definitions that cannot be read.
    """
    frame = declared.frame() if frame is None else frame
    path, contents = recording.path, recording.contents
    tree = static_tree(recording) or TransformTree()
    no_speeds = not_of_the_body(recording)
    chosen = _choose(
        contents, no_speeds, of_other_bodies(recording, tree), placed=frame is not None
    )
    positions = next((one for one in chosen if "gnss" in one.how.channels), None)
    if positions is None:
        kinds = sorted({schema.name for schema in contents.schemas.values()})
        hint = f"; with [map] declared in {path.name}.toml {ODOMETRY} would do"
        raise LogError(
            f"{path}: no topic of type sensor_msgs/msg/NavSatFix, so no positions;"
            f" types: {', '.join(kinds) or 'none'}"
            + (hint if ODOMETRY in kinds and frame is None else "")
        )
    decode = decoder(recording, {one.topic for one in chosen})
    if positions.how is POSE:
        _place_body(recording, positions.topic, decode, tree, declared)
    imu = next((one.topic for one in chosen if "imu" in one.how.channels), None)
    mounting = ImuMounting() if imu is None else imu_mounting(recording, imu, decode, tree)
    if not mounting.upright:
        chosen = [one for one in chosen if one.topic != imu]

    speed = next((one.topic for one in chosen if one.how.stream == "speed"), "no topic")
    left_out = {
        f"{why} ({topic}; {speed} is taken)": contents.counts.get(topic, 0)
        for topic, why in no_speeds.items()
    }

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if contents.cut_short:
            skipped[FILE_CUT_SHORT] += 1
        skipped.update(left_out)
        if not mounting.upright:
            skipped[NOT_UPRIGHT] += contents.counts[imu or ""]
        clock = FixClock(lag_ns, most_ahead_ns=WINDOW_NS)
        samples = _foreign_samples(recording, chosen, decode, frame, tree, mounting, clock, skipped)
        return _joined(reordered(samples, window_ns=WINDOW_NS), skipped)

    # Header stamps differ from log times by the transport's delay, and at times by a whole epoch.
    lag_ns, antenna_frame = _first_fix(recording, positions.topic, decode)
    start_ns = contents.first_ns - lag_ns
    antenna_m = declared.body_from_antenna_m
    if positions.how is POSE:
        antenna_m = (0.0, 0.0, 0.0)
    elif antenna_m is None and antenna_frame:
        antenna_m = tree.place_of(antenna_frame, within=BASE_FRAME)
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base_of(start_ns),
            start_stamp_ns=start_ns,
            end_stamp_ns=contents.last_ns - lag_ns,
            source=path.name,
            reference_point=BASE_FRAME if positions.how is POSE else "antenna",
            body_from_antenna_m=antenna_m,
            sends=tuple(dict.fromkeys(channel for one in chosen for channel in one.how.channels)),
        ),
        read=read,
    )


def time_base_of(stamp_ns: int) -> drive.TimeBase:
    """Guess the time base from one stamp."""
    return "utc" if stamp_ns > _UTC_FROM_NS else "log"


class _Chosen(NamedTuple):
    """A topic and how its messages are read."""

    topic: str
    how: Foreign


def _choose(
    contents: Contents, no_speeds: Collection[str], doubted: Collection[str], *, placed: bool
) -> list[_Chosen]:
    """Return one topic for each stream, none of `no_speeds` for the speed, `doubted` ones last.

    `placed` tells whether `map` has a place on Earth.
    """

    def topic_of(kind: str, refused: Collection[str] = ()) -> str | None:
        topics = [
            topic
            for topic, schema in contents.schemas.items()
            if schema.name == kind and contents.counts.get(topic, 0) > 0 and topic not in refused
        ]
        return max(topics, key=lambda topic: (contents.counts[topic], topic), default=None)

    chosen: dict[str, _Chosen] = {}
    for refused in ({*no_speeds, *doubted}, no_speeds):
        for kind, how in FOREIGN.items():
            topic = topic_of(kind, refused)
            if topic is not None and how.stream not in chosen:
                chosen[how.stream] = _Chosen(topic, how)
    pose = topic_of(ODOMETRY, doubted) or topic_of(ODOMETRY)
    if POSE.stream not in chosen and placed and pose is not None:
        chosen[POSE.stream] = _Chosen(pose, POSE)
    return list(chosen.values())


def _first_fix(recording: RosRecording, topic: str, decode: Decode) -> tuple[int, str]:
    """Return how far the log time is ahead of the first readable fix's stamp, and its frame."""
    for record in recording.chosen({topic}, Counter()):
        try:
            ros = decode(record)
            lag_ns = record.log_time_ns - (stamp_of(ros) or record.log_time_ns)
            return lag_ns, str(ros.header.frame_id)
        except Exception:  # an unreadable message, counted when it is read
            continue
    return 0, ""


def _place_body(
    recording: RosRecording,
    topic: str,
    decode: Decode,
    tree: TransformTree,
    declared: RecordingDeclaration,
) -> None:
    """Put the body of an Odometry where it is declared to be; raises LogError for an unknown one.

    Of whatever point of the car the positions are, its declared place is that.
    """
    for record in recording.chosen({topic}, Counter()):
        try:
            ros = decode(record)
        except Exception:  # an unreadable message, counted when it is read
            continue
        if is_of_base(of_base(ros, tree)):
            return
        if declared.body_from_antenna_m is None:
            raise LogError(
                f"{recording.path}: {topic} is odometry of {ros.child_frame_id!r}, not of"
                f" {BASE_FRAME}, and no static transform tells its place; declare that as"
                f" body_from_antenna_m in {recording.path.name}.toml"
            )
        tree.put(str(ros.child_frame_id), within=BASE_FRAME, place_m=declared.body_from_antenna_m)
        return


def _foreign_samples(
    recording: RosRecording,
    chosen: Sequence[_Chosen],
    decode: Decode,
    frame: LocalFrame | None,
    tree: TransformTree,
    mounting: ImuMounting,
    clock: FixClock,
    skipped: Counter[str],
) -> Iterator[Sample]:
    readers: dict[str, list[Foreign]] = {}
    for one in chosen:
        readers.setdefault(one.topic, []).append(one.how)
    fixes = {one.topic for one in chosen if "gnss" in one.how.channels}
    for record in recording.chosen(set(readers), skipped):
        try:
            ros = decode(record)
            if record.kind == ODOMETRY:
                ros = of_base(ros, tree)
            stamp_ns = stamp_of(ros) or record.log_time_ns
        except Exception:  # whatever rosbags raises over broken bytes
            skipped[UNREADABLE_ROW] += 1
            continue
        if not clock.takes(stamp_ns, record.log_time_ns, is_fix=record.topic in fixes):
            skipped[OTHER_CLOCK] += 1
            continue
        for how in readers[record.topic]:
            try:
                messages = how.read(ros, stamp_ns, frame)
            except UnusableError as reason:
                skipped[str(reason)] += 1
            except Exception:  # values that cannot be what they stand for
                skipped[UNREADABLE_ROW] += 1
            else:
                for message in messages:
                    if isinstance(message, drive.ImuSample):
                        message = mounting.in_the_cars_axes(message)
                    yield channel_of(message), message


def _joined(samples: Iterator[Sample], skipped: Counter[str]) -> Iterator[Sample]:
    """Join the reports of a status, those of one stamp to one sample, and commands with speeds."""
    joiner, commands = StatusJoiner(), AckermannCommands()
    waiting: drive.VehicleStatus | None = None
    for channel, message in samples:
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if waiting is not None and stamp_ns != waiting.stamp_ns:
            yield "status", waiting
            waiting = None
        match message:
            case StatusPart():
                waiting = joiner.join(message)
                continue
            case drive.SpeedSample():
                commands.note(message)
            case AckermannTarget():
                command = commands.command(message)
                if command is None:
                    skipped[NO_ACCELERATION] += 1
                    continue
                message = command
        yield channel, message
    if waiting is not None:
        yield "status", waiting
