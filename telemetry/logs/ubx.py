"""Reader of u-blox UBX logs: NAV-PVT, the receiver's position, speed and time of one instant.

Declares: degrees on WGS84 of 1e-7, height above the ellipsoid, UTC, reference point the antenna
(its place on the car is not told). The standard deviation on each axis is `hAcc`, as the drivers
for ROS take it. Speed is that over ground; where the receiver knows the vehicle's heading it is
signed by it, and that heading is taken, else the course over ground above MIN_COURSE_MPS. Degrees
are clockwise from true north.

The layout is that of the interface descriptions (u-blox 8 / M8, ZED-F9P), where NAV-PVT has 92
bytes, 84 in protocols before 14. Other messages, of RTCM and NMEA too, may stand between; raw
measurements, and ESF's of the sensors in the receiver, are left out.
"""

from __future__ import annotations

import datetime
import math
import struct
from array import array
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.log import FILE_CUT_SHORT, Log, LogError
from foretwin.telemetry.logs.nmea import MIN_COURSE_MPS
from foretwin.telemetry.logs.nmea_sentences import CHECKSUM_WRONG, yaw_rad_of
from foretwin.telemetry.ros_messages.foreign import NO_FIX

TIME_UNKNOWN = "receiver without time"
SYNC = b"\xb5\x62"
_PVT = b"\x01\x07"
_PVT_BYTES = (84, 92)
_LAYOUT = struct.Struct("<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH")
"""iTOW, year, month, day, hour, minute, second, valid, tAcc, nano, fixType, flags, flags2, numSV,
lon, lat, height, hMSL, hAcc, vAcc, velN, velE, velD, gSpeed, headMot, sAcc, headAcc, pDOP,
flags3."""
_VEHICLE_HEADING_AT = 84
_DATE_AND_TIME = 0b011
_FIX_OK, _VEHICLE_HEADING_KNOWN = 0b1, 0b10_0000
_INVALID_PLACE = 0b1
"""invalidLlh of flags3: longitude, latitude and heights are none."""
_UNKNOWN = 0xFFFF_FFFF
_FIXES = (1, 2, 3, 4)
"""Dead reckoning, 2D, 3D, both; the receiver's own limits are in _FIX_OK."""
_CHUNK_BYTES = 1 << 20
_MOST_FRAME_BYTES = 65_535 + 8
_AFTER_FRAME = (SYNC[0], ord("$"), 0xD3)
"""What the next UBX, NMEA or RTCM message begins with."""
_EPOCH = datetime.datetime(1970, 1, 1)


class _Rows(NamedTuple):
    """Samples of a channel: stamps, and the numbers of each after the other's."""

    stamps_ns: array[int]
    numbers: array[float]

    def add(self, stamp_ns: int, *numbers: float) -> None:
        self.stamps_ns.append(stamp_ns)
        self.numbers.extend(numbers)

    def stream(self, channel: str) -> Stream:
        table = np.frombuffer(self.numbers).reshape(len(self.stamps_ns), -1)
        return stream_of(channel, np.frombuffer(self.stamps_ns, dtype=np.int64), table)


_Channels = dict[str, _Rows]


def is_ubx(head: bytes) -> bool:
    """Tell whether a file that begins so holds UBX: a whole message, or the beginning of one."""
    at = head.find(SYNC)
    while at >= 0:
        size = _size(head, at)
        if size is not None and (whole := head[at : at + size]) and len(whole) == size:
            if _checksum(whole[2:-2]) == whole[-2:]:
                return True
        elif at == 0:
            return True
        at = head.find(SYNC, at + 1)
    return False


def open_ubx(path: Path) -> Log:
    """Open a UBX log; raises LogError where it has no NAV-PVT with a fix."""
    refused: Counter[str] = Counter()
    rows = {name: _Rows(array("q"), array("d")) for name in ("gnss", "speed", "heading")}
    seen = 0
    for payload in _positions(path, refused):
        seen += 1
        if (fault := _take(payload, rows)) is not None:
            refused[fault] += 1
    if not rows["gnss"].stamps_ns:
        why = ", ".join(f"{count} x {reason}" for reason, count in refused.items())
        told = f"no NAV-PVT with a fix ({why})" if seen or why else "no NAV-PVT message in it"
        raise LogError(f"{path}: {told}; u-blox receivers send positions as UBX-NAV-PVT")
    streams = {name: found.stream(name) for name, found in rows.items() if found.stamps_ns}
    return table_log(
        path.name,
        streams,
        stamps_ns=streams["gnss"].stamps_ns,
        time_base="utc",
        reference_point="antenna",
        refused=refused,
    )


def _size(data: bytes | bytearray, at: int) -> int | None:
    """Return the bytes of the message that begins at `at`, None before its length is known."""
    if len(data) < at + 6:
        return None
    length: int = struct.unpack_from("<H", data, at + 4)[0]
    return length + 8


def _checksum(data: bytes | bytearray) -> bytes:
    """Return Fletcher's checksum of class, id, length and payload."""
    first = second = 0
    for byte in data:
        first += byte
        second += first
    return bytes((first & 0xFF, second & 0xFF))


def _positions(path: Path, refused: Counter[str]) -> Iterator[bytes]:
    """Yield the payload of every NAV-PVT; what is damaged is counted, and the next one sought."""
    with path.open("rb") as file:
        data, at, ended = bytearray(), 0, False
        whole_to = 0
        while True:
            if not ended and len(data) - at < _MOST_FRAME_BYTES:
                del data[:at]
                whole_to -= at
                at = 0
                more = file.read(_CHUNK_BYTES)
                data += more
                ended = not more
                continue
            at = data.find(SYNC, at)
            if at < 0:
                if ended:
                    return
                at = len(data) - 1
                continue
            wanted = data[at + 2 : at + 4] == _PVT
            size = _size(data, at)
            if size is None or at + size > len(data):
                # Where the last message, or a line of NMEA, ended one begins; elsewhere it may be a
                # number.
                begins = at == whole_to or data[max(at - 2, 0) : at] == b"\r\n"
                if begins or (wanted and size is not None and size - 8 in _PVT_BYTES):
                    refused[FILE_CUT_SHORT] += 1
                at += 2
            elif not wanted:
                after = data[at + size] if at + size < len(data) else SYNC[0]
                at += size if after in _AFTER_FRAME else 2
                whole_to = at if after in _AFTER_FRAME else whole_to
            elif size - 8 in _PVT_BYTES and _checksum(data[at + 2 : at + size - 2]) == bytes(
                data[at + size - 2 : at + size]
            ):
                yield bytes(data[at + 6 : at + size - 2])
                at = whole_to = at + size
            else:
                refused[CHECKSUM_WRONG] += 1
                at += 2


def _take(payload: bytes, rows: _Channels) -> str | None:
    """Add what a NAV-PVT says to the rows, or return why nothing of it is used."""
    (_, year, month, day, hour, minute, second, valid, _, nano, kind, flags, _, _, lon, lat, height,
     _, h_acc, _, _, _, _, speed, course, *_, flags3) = _LAYOUT.unpack_from(payload)  # fmt: skip
    if valid & _DATE_AND_TIME != _DATE_AND_TIME:
        return TIME_UNKNOWN
    # Before protocol 14 what stands there is reserved.
    invalid = flags3 & _INVALID_PLACE and len(payload) > _VEHICLE_HEADING_AT
    if kind not in _FIXES or not flags & _FIX_OK or invalid:
        return NO_FIX
    try:
        # A leap second is second 60.
        whole = datetime.datetime(year, month, day, hour, minute) - _EPOCH
    except ValueError:
        return TIME_UNKNOWN
    stamp_ns = round(whole.total_seconds() + second) * 10**9 + nano
    std_m = math.nan if h_acc == _UNKNOWN else h_acc * 1e-3
    rows["gnss"].add(stamp_ns, lat * 1e-7, lon * 1e-7, height * 1e-3, std_m)
    speed_mps, course_deg = speed * 1e-3, course * 1e-5
    if flags & _VEHICLE_HEADING_KNOWN and len(payload) > _VEHICLE_HEADING_AT:
        vehicle_deg = struct.unpack_from("<i", payload, _VEHICLE_HEADING_AT)[0] * 1e-5
        backwards = math.cos(math.radians(course_deg - vehicle_deg)) < 0.0
        rows["speed"].add(stamp_ns, -speed_mps if backwards else speed_mps)
        rows["heading"].add(stamp_ns, yaw_rad_of(vehicle_deg))
        return None
    rows["speed"].add(stamp_ns, speed_mps)
    if speed_mps >= MIN_COURSE_MPS:
        rows["heading"].add(stamp_ns, yaw_rad_of(course_deg))
    return None
