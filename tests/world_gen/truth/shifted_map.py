"""A real map taken as the truth, and the same map as careless mappers would have drawn it.

What it cannot tell is how people drive: passes follow the truth's own lanes and turns, with a
driver's and a receiver's wander. What it can: whether the right lane is found and moved, as the
true place of every lane is known.
"""

from __future__ import annotations

import re

import numpy as np
from scipy.ndimage import gaussian_filter1d

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.geometry.polyline import arc_lengths, left_of, points_at, tangents, without_repeats
from tests.world_gen.truth.lane_model import LaneModel

ERROR_M, ALIKE_M = 1.0, 60.0
"""Standard deviation of a node's place in each direction, and how far nodes err alike."""
WANDER_M, WANDER_ALIKE_M = 0.25, 15.0
"""The same of driver and receiver about the middle of the lane."""
_WAVES = 400
_NODE = re.compile(r'(<node id="(-?\d+)"[^>]*?lat=")([-\d.]+)("[^>]*?lon=")([-\d.]+)"')


def shifted(text: str, frame: LocalFrame, *, seed: int) -> str:
    """Return .osm text with its nodes moved by a smooth random field."""
    random = np.random.default_rng(seed)
    # A sum of waves has a Gaussian correlation over ALIKE_M.
    waves = random.normal(0.0, 1.0 / ALIKE_M, (_WAVES, 2))
    phases = random.uniform(0.0, 2.0 * np.pi, (_WAVES, 2))
    found = list(_NODE.finditer(text))
    lat_lon = np.array([(float(m[3]), float(m[5])) for m in found])
    xy_m = local_from_geo(frame, lat_lon[:, 0], lat_lon[:, 1])
    angle = xy_m @ waves.T
    scale = ERROR_M * np.sqrt(2.0 / _WAVES)
    shift = scale * np.stack([np.cos(angle + phases[:, k]).sum(axis=1) for k in (0, 1)], axis=1)
    places = iter(geo_from_local(frame, xy_m + shift).tolist())

    def moved(match: re.Match[str]) -> str:
        lat, lon = next(places)
        return f'{match[1]}{lat:.8f}{match[4]}{lon:.8f}"'

    return _NODE.sub(moved, text)


def routes(model: LaneModel, *, count: int, length_m: float, seed: int) -> list[Array]:
    """Return ways along lanes and connections, each at random wherever there is a choice."""
    random = np.random.default_rng(seed)
    after: dict[str, list[tuple[str, Array]]] = {}
    for c in model.connections:
        after.setdefault(c.from_lane, []).append((c.to_lane, c.line))
    for a, b in model.joins:
        after.setdefault(a, []).append((b, model.lanes[b].line[:1]))
    keys = list(model.lanes)
    found: list[Array] = []
    while len(found) < count:
        key = keys[random.integers(len(keys))]
        parts, driven_m = [model.lanes[key].line], 0.0
        while driven_m < length_m and after.get(key):
            choices = after[key]
            key, link = choices[random.integers(len(choices))]
            parts += [link, model.lanes[key].line]
            driven_m += float(arc_lengths(parts[-1])[-1])
        if driven_m >= length_m:
            found.append(without_repeats(np.concatenate(parts), tolerance_m=0.05))
    return found


def wandering(line: Array, *, seed: int) -> Array:
    """Return places each metre along a line, as somebody drives and measures it."""
    random = np.random.default_rng(abs(2 * seed) + (seed < 0))
    even = points_at(line, np.arange(0.0, arc_lengths(line)[-1], 1.0))
    noise = gaussian_filter1d(random.normal(size=len(even) + 200), WANDER_ALIKE_M)[100:-100]
    noise *= WANDER_M * np.sqrt(2.0 * np.sqrt(np.pi) * WANDER_ALIKE_M)
    return np.asarray(even + noise[:, None] * left_of(tangents(even)))
