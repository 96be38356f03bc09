"""Real drives over Karlsruhe's crossing K729, labelled by hand from pictures of their tracks.

Cars and people were tracked by cameras beside the road. One car is taken for the car, all others
for its detections; there is no World, so what is known is the motion alone.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.sim_worker.analysis.occurred.recognise import recognise
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import Detected, even_motion
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.analysis.occurred.scenes import CAR
from tests.sim_worker.realism.recordings import motion

ORIGIN = LocalFrame(GeoPoint(49.01160993928274, 8.43856470258739))


class ByHand(NamedTuple):
    """What a person sees in the picture of one car's passage."""

    recording: str
    car: str
    seen: tuple[tuple[str, str], ...]
    """Kinds, each with whom."""


LABELS = (
    # Stand, let somebody cross the street that they turn right into, and turn.
    ByHand(
        "009", "1427", (("turn_right", ""), ("standstill", ""), ("pedestrian_crossing", "9042"))
    ),
    ByHand("001", "27", (("turn_right", ""), ("standstill", ""), ("pedestrian_crossing", "7699"))),
    # Waits long; the last one crosses as it turns.
    ByHand(
        "015", "2956", (("turn_right", ""), ("standstill", ""), ("pedestrian_crossing", "7430"))
    ),
    # Stops at the light, stands for 20 s; oncoming cars pass beside, one turns off ahead.
    ByHand("013", "2690", (("stop", ""), ("standstill", ""))),
    # Straight over; people walk along beside it.
    ByHand("008", "1120", ()),
    ByHand("003", "488", ()),
    # Right behind one who turns right as well; behind the second somebody crosses the street.
    ByHand("010", "1518", (("turn_right", ""), ("following", "1482"))),
    ByHand(
        "004",
        "517",
        (("turn_right", ""), ("following", "511"), ("pedestrian_crossing", "8634")),
    ),
    # One of a column, in view together with the one ahead for 2 s: too short to be followed.
    ByHand("013", "2705", ()),
)


def tracks(file: Path) -> dict[str, tuple[str, np.ndarray]]:
    """Kind and rows (N, 3) of seconds, x and y of everybody in a recording."""
    rows: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    kinds = {}
    with file.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            kinds[row["track_id"]] = row["agent_type"]
            rows[row["track_id"]].append(
                (float(row["timestamp_ms"]) / 1e3, float(row["x"]), float(row["y"]))
            )
    return {name: (kinds[name], np.array(given)) for name, given in rows.items()}


def seen_by(data: Path, one: ByHand) -> tuple[OccurredScenario, ...]:
    """What is recognised of one car's passage."""
    folder = data / "traffic-karlsruhe-k729"
    everybody = tracks(folder / f"vehicle_tracks_{one.recording}.csv")
    _, own = everybody.pop(one.car)
    xy, moved = own[:, 1:], motion(own[:, 1:])
    step = np.gradient(xy, axis=0)
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    fast = moved.speed_mps > 0.7
    yaw = np.interp(own[:, 0], own[fast, 0], course[fast])
    base = xy - box_centre_from_base_m(CAR) * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    stamps = np.round(own[:, 0] * 1e9).astype(np.int64)
    rate = np.gradient(yaw, own[:, 0])
    ego = even_motion(stamps, base, yaw, moved.speed_mps, moved.along_mps2, rate)
    others = [
        Detected(
            name,
            "pedestrian" if kind == "Pedestrian" else "car",
            None,
            np.round(rows[:, 0] * 1e9).astype(np.int64),
            rows[:, 1:],
            np.full(len(rows), np.nan),
        )
        for name, (kind, rows) in everybody.items()
    ]
    return recognise(ego, others, Roads((), ORIGIN), vehicle=CAR)


@pytest.mark.real_data
@pytest.mark.parametrize("one", LABELS, ids=lambda one: f"{one.recording}-{one.car}")
def test_real_passages_are_seen_as_a_person_sees_them(one: ByHand, data_dir: Path) -> None:
    found = seen_by(data_dir, one)

    assert sorted((row.kind, row.other_id) for row in found) == sorted(one.seen)
