"""Junctions drawn at random: roads of many kinds that meet in one node, and their mirror images."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hypothesis import strategies as st

from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import GERMANY, IRELAND, drawn_map, world_of

ARM_M = 110.0
_SIDES = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class Arm:
    """One road from the middle outward: its bearing, a bend on its way, its tags."""

    bearing_deg: float
    bend_m: float
    inward: bool
    tags: tuple[tuple[str, str], ...]


@st.composite
def tags_of_a_road(draw: st.DrawFn) -> tuple[tuple[str, str], ...]:
    tags = {"highway": draw(st.sampled_from(["residential", "tertiary", "secondary", "primary"]))}
    forward, backward = draw(st.integers(1, 3)), draw(st.integers(0, 3))
    if backward == 0:
        tags |= {"oneway": "yes", "lanes": str(forward)}
    else:
        tags |= {
            "lanes": str(forward + backward),
            "lanes:forward": str(forward),
            "lanes:backward": str(backward),
        }
    if draw(st.booleans()):
        words = ["left", "through", "through;right"][-forward:]
        key = "turn:lanes" if backward == 0 else "turn:lanes:forward"
        tags[key] = "|".join(words)
    for side in ("left", "right"):
        if draw(st.integers(0, 3)) == 0:
            tags[f"cycleway:{side}"] = "lane"
        if draw(st.integers(0, 3)) == 0:
            tags[f"parking:{side}"] = "lane"
            tags[f"parking:{side}:orientation"] = draw(st.sampled_from(["parallel", "diagonal"]))
    return tuple(sorted(tags.items()))


@st.composite
def stars(draw: st.DrawFn, *, least_gap_deg: float = 25.0) -> tuple[Arm, ...]:
    count = draw(st.integers(3, 5))
    gaps = [draw(st.floats(least_gap_deg, 120.0)) for _ in range(count)]
    scale = 360.0 / sum(gaps)
    if min(gaps) * scale < least_gap_deg:
        gaps = [360.0 / count] * count
        scale = 1.0
    bearing = draw(st.floats(0.0, 90.0))
    arms = []
    for gap in gaps:
        arms.append(
            Arm(
                bearing_deg=round(bearing, 2),
                bend_m=draw(st.sampled_from([0.0, 0.0, 8.0, -12.0])),
                inward=draw(st.booleans()),
                tags=draw(tags_of_a_road()),
            )
        )
        bearing += gap * scale
    return tuple(arms)


def world_of_star(arms: tuple[Arm, ...], *, left_hand: bool = False, mirror: bool = False) -> World:
    """Return the World where the arms meet; mirrored, what was left is right, tags too."""
    nodes = {0: (0.0, 0.0)}
    ways = []
    for i, arm in enumerate(arms):
        angle = math.radians(arm.bearing_deg)
        across = angle + math.pi / 2
        half = (
            ARM_M / 2 * math.cos(angle) + arm.bend_m * math.cos(across),
            ARM_M / 2 * math.sin(angle) + arm.bend_m * math.sin(across),
        )
        nodes[10 + i] = half
        nodes[20 + i] = (ARM_M * math.cos(angle), ARM_M * math.sin(angle))
        refs = [20 + i, 10 + i, 0] if arm.inward else [0, 10 + i, 20 + i]
        tags = dict(arm.tags) | {"name": f"Arm {i}"}
        ways.append((100 + i, refs, mirrored_tags(tags) if mirror else tags))
    if mirror:
        nodes = {node: (-x, y) for node, (x, y) in nodes.items()}
    return world_of(drawn_map(nodes, ways, origin=IRELAND if left_hand else GERMANY))


def mirrored_tags(tags: dict[str, str]) -> dict[str, str]:
    """Return tags as they would stand in a world seen in a mirror."""
    found = {}
    for key, value in tags.items():
        for side, other in _SIDES.items():
            if f":{side}" in key:
                key = key.replace(f":{side}", f":{other}")
                break
        if key.startswith("turn:lanes"):
            value = "|".join(
                ";".join(_SIDES.get(word, word) for word in lane.split(";"))
                for lane in reversed(value.split("|"))
            )
        found[key] = value
    return found
