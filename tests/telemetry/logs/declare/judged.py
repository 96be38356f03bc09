"""A proposed declaration held against the drive that a table was made of: what is right in it?"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.logs.columns import Stream
from foretwin.telemetry.logs.csv_table import open_csv
from foretwin.telemetry.logs.declare import Proposal, propose
from foretwin.telemetry.logs.declare.choice import CountryOf
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.write_declaration import declaration_toml
from tests.telemetry.logs.declare.disguised import Drive, Table, drive_of

Verdict = Literal["right", "unknown", "wrong"]


class Judged(NamedTuple):
    """Verdicts by channel and field, how often was asked, and the latenesses that were declared."""

    verdicts: dict[str, Verdict]
    asked: int
    late_s: dict[str, float]
    why: list[str]
    refused: str = ""


def judged(table: Table, *, country_of: CountryOf | None = None) -> Judged:
    """Declare a table, read it, and hold each number against the truth at its row's time."""
    answers: dict[str, str] = {}
    asked = 0
    try:
        found = propose(table.path, country_of=country_of)
        while found.question is not None and asked < 3:
            asked += 1
            answers[found.question.key] = table.answers.get(found.question.key, "?")
            found = propose(table.path, country_of=country_of, answers=answers)
    except LogError as error:
        return Judged({}, asked, {}, [], str(error))
    return _against_truth(table, found, asked)


def _against_truth(table: Table, found: Proposal, asked: int) -> Judged:
    assert found.declaration is not None
    declaration = table.path.with_name(table.path.name + ".toml")
    declaration.write_text(declaration_toml(found.declaration, said=found.evidence))
    read = drive_of(open_csv(table.path, declaration=declaration))
    late_s = {}
    verdicts: dict[str, Verdict] = {}
    why: list[str] = []
    for channel in read:
        section = getattr(found.declaration, "position" if channel == "gnss" else channel)
        late_s[channel] = section.late_s
    for channel, field in (
        ("gnss", "place"), ("gnss", "altitude"), ("speed", "forward"), ("heading", "yaw"),
        ("imu", "accel_x"), ("imu", "accel_y"), ("imu", "accel_z"), ("steering", "wheel"),
        ("steering", "tire"), ("any", "rate_z"),
    ):  # fmt: skip
        true, said = _field(table.truth, channel, field), _field(read, channel, field)
        if true is None and said is None:
            continue
        key = f"{channel}.{field}"
        if said is None or _left_out(field, said[1]):
            verdicts[key] = "unknown"
        elif true is None:
            verdicts[key] = "wrong"
            why.append(f"{key}: there is none")
        else:
            channel_late = late_s.get(channel, late_s.get("imu", late_s.get("heading", 0.0)))
            off, allowed = _off(true, said, round(channel_late * 1e9), field)
            verdicts[key] = "right" if off <= allowed else "wrong"
            if off > allowed:
                why.append(f"{key}: off by {off:.3g} of {allowed:.3g}")
    return Judged(verdicts, asked, late_s, why)


def _left_out(field: str, values: Array) -> bool:
    """Tell whether a reader filled in a field that nothing was declared for."""
    if field == "altitude":
        return bool(np.max(np.abs(values)) < 0.1)
    return field in ("accel_y", "accel_z") and bool(np.ptp(values) == 0.0)


def _field(drive: Drive, channel: str, field: str) -> tuple[np.ndarray, Array] | None:
    if field == "rate_z":
        imu, heading = drive.get("imu"), drive.get("heading")
        if imu is not None:
            return imu.stamps_ns, imu.columns["rate_z"]
        if heading is not None and "yaw_rate" in heading.columns:
            return heading.stamps_ns, heading.columns["yaw_rate"]
        return None
    stream: Stream | None = drive.get(channel)
    if stream is None:
        return None
    if field == "place":
        return stream.stamps_ns, np.stack(
            [stream.columns["latitude"], stream.columns["longitude"]], 1
        )
    values = stream.columns.get(field)
    return None if values is None else (stream.stamps_ns, values)


def _off(
    true: tuple[np.ndarray, Array], said: tuple[np.ndarray, Array], late_ns: int, field: str
) -> tuple[float, float]:
    """Return the 90th percentile of what is off, and how much may be."""
    at = np.searchsorted(true[0], said[0] + late_ns + 2_000, side="right") - 1
    known = at >= 0
    was, said_values = true[1][at[known]], said[1][known]
    if field == "place":
        frame = LocalFrame(GeoPoint(*map(float, true[1][0])))
        xy = [local_from_geo(frame, *columns.T) for columns in (was, said_values)]
        return float(np.percentile(np.hypot(*(xy[1] - xy[0]).T), 90)), 0.03
    if field == "yaw":
        off = np.abs(np.angle(np.exp(1j * (said_values - was))))
        return float(np.percentile(off, 50)), np.radians(3.0)
    size = float(np.sqrt(np.mean(was**2)))
    return float(np.percentile(np.abs(said_values - was), 90)), 0.02 * size + 1e-4
