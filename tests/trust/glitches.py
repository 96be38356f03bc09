"""What receivers do wrong, put into a clean drive: seeded, one after the other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, NamedTuple, get_args

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import Sample

Kind = Literal["step", "single", "drop", "ramp", "frozen", "sigma_small", "sigma_large"]
KINDS: tuple[Kind, ...] = get_args(Kind)
SPACING_S = 8.0
"""From one glitch to the next: time enough to come back."""
_METRES_PER_DEG = 111_320.0


class Glitch(NamedTuple):
    """A fault of the receiver from `begin_s` until `end_s`, in seconds since the first fix.

    `off_m` (east, north) is how far a step, a single fix or a ramp's end lies off; a wrong sigma
    is wrong by 100: stated so much too small, with noise of 2 m, or too large.
    """

    kind: Kind
    begin_s: float
    end_s: float
    off_m: tuple[float, float]


def glitches(count: int, *, from_s: float, seed: int) -> list[Glitch]:
    """Return `count` glitches of all kinds in turn, every `SPACING_S` seconds."""
    random = np.random.default_rng(seed)
    found = []
    for k in range(count):
        kind = KINDS[int(random.integers(len(KINDS)))]
        begin_s = from_s + SPACING_S * k + float(random.uniform(0.0, 2.0))
        angle, size = random.uniform(0.0, 2.0 * np.pi), random.uniform(0.3, 2.0)
        lasts_s = {
            "step": SPACING_S * count,
            "single": 0.0,
            "drop": float(random.uniform(0.5, 2.0)),
            "ramp": float(random.uniform(2.0, 4.0)),
            "frozen": float(random.uniform(0.4, 1.5)),
            "sigma_small": 3.0,
            "sigma_large": 3.0,
        }[kind]
        off = (float(size * np.cos(angle)), float(size * np.sin(angle)))
        found.append(Glitch(kind, begin_s, begin_s + lasts_s, off))
    return found


def glitched(
    samples: Iterable[Sample], planted: list[Glitch], *, seed: int, true_std_m: float = 0.02
) -> list[Sample]:
    """Return the samples with the glitches in their fixes; `true_std_m` is what a fix may state."""
    random = np.random.default_rng(seed)
    found: list[Sample] = []
    first_ns, before_ns = None, 0
    frozen: GeoPoint | None = None
    for channel, message in samples:
        if not isinstance(message, GnssFix):
            found.append((channel, message))
            continue
        first_ns = message.stamp_ns if first_ns is None else first_ns
        time_s, before_s = (message.stamp_ns - first_ns) * 1e-9, (before_ns - first_ns) * 1e-9
        before_ns = message.stamp_ns
        off, std, dropped, place = np.zeros(2), message.std_m, False, message.position
        holds = False
        for one in planted:
            now = one.begin_s <= time_s <= one.end_s
            if one.kind == "single":
                now = before_s < one.begin_s <= time_s
            if not now:
                continue
            if one.kind == "ramp":
                off += np.array(one.off_m) * (time_s - one.begin_s) / (one.end_s - one.begin_s)
            elif one.kind in ("step", "single"):
                off += np.array(one.off_m)
            elif one.kind == "sigma_small":
                off += random.normal(0.0, 100.0 * true_std_m, 2)
                std = true_std_m
            elif one.kind == "sigma_large":
                std = 100.0 * true_std_m
            holds, dropped = holds or one.kind == "frozen", dropped or one.kind == "drop"
        if dropped:
            continue
        place = frozen if holds and frozen is not None else _moved(place, off)
        frozen = place
        found.append((channel, msgspec.structs.replace(message, position=place, std_m=std)))
    return found


def _moved(place: GeoPoint, off_m: np.ndarray) -> GeoPoint:
    per_deg = _METRES_PER_DEG * np.cos(np.radians(place.lat_deg))
    return GeoPoint(
        float(place.lat_deg + off_m[1] / _METRES_PER_DEG),
        float(place.lon_deg + off_m[0] / per_deg),
        place.alt_m,
    )
