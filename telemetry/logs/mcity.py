"""Reader of road users at Mcity's junction: satellite positions of test cars, roadside detections.

The format of the University of Michigan's evaluation of roadside perception: a JSON list of
instants with their `objs`. Declares: WGS84 degrees, UTC seconds. `speed` is in km/h (over six
trials 1.00 to 1.02 times what the positions give); `rotation` is the direction of the box, counter-
clockwise from east, by either of its ends (within 12° of the course or its opposite). Of cars with
satellite receivers nothing but positions is recorded; where the antenna sits is not documented, and
taken to be the middle. Class 2 are cars, 10 walkers.
"""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from foretwin.contracts.drive import RoadUserKind
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.road_users import Detection
from foretwin.telemetry.logs.units import SPEED

_KINDS: dict[str, RoadUserKind] = {"2": "car", "10": "pedestrian"}


class _Object(msgspec.Struct, frozen=True, kw_only=True, rename={"kind": "classType"}):
    id: str | int
    lat: float
    lon: float
    kind: str | int
    speed: float = math.nan
    rotation: float = math.nan
    length: float = math.nan
    width: float = math.nan


class _Instant(msgspec.Struct, frozen=True, kw_only=True):
    timestamp: float
    objs: tuple[_Object, ...]


def is_mcity(head: str) -> bool:
    """Tell whether a file that begins with `head` may be such a list; no other log is a list."""
    return head.lstrip("\ufeff \t\r\n").startswith("[")


def read_mcity(path: Path) -> list[tuple[int, list[Detection]]]:
    """Return stamps in ns and who was there; raises LogError for a file that is no such list."""
    try:
        # Numbers come as such or as text.
        instants = msgspec.json.decode(path.read_bytes(), type=list[_Instant], strict=False)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: {error}; expected a list of timestamp and objs") from None
    for number, instant in enumerate(instants):
        if not 0.0 <= instant.timestamp < 2.0**31:
            raise LogError(f"{path}: [{number}].timestamp {instant.timestamp}: no UTC seconds")
    return [
        (round(instant.timestamp * 1e9), [_detection(one) for one in instant.objs])
        for instant in instants
    ]


def _detection(one: _Object) -> Detection:
    kind = _KINDS.get(str(one.kind), "unknown")
    return Detection(
        str(one.id),
        kind,
        one.lat,
        one.lon,
        # Walkers have no long side to tell a direction by.
        axis_rad=math.nan if kind == "pedestrian" else one.rotation,
        speed_mps=one.speed * SPEED["km/h"],
        length_m=one.length,
        width_m=one.width,
    )
