"""Lanes: turn lanes, placement, change, bus, bicycle, parking, centre lanes, ramps."""

from __future__ import annotations

from tests.data.junctions.draw_control import PRIORITY
from tests.data.junctions.draw_crossings import CENTRE, GIVE_WAY
from tests.data.junctions.drawing import OHIO, Drawing


def stem(d: Drawing, **tags: str) -> None:
    d.node(0, -9, **GIVE_WAY)
    d.way("Südweg", "tertiary", (0, -120), (0, -9), CENTRE, **tags)


def turn_lanes(d: Drawing) -> None:
    d.way("Westweg", "secondary", (-120, 0), CENTRE, lanes="4", lanes__forward="3",
          lanes__backward="1", turn__lanes__forward="left|through|right", **PRIORITY)  # fmt: skip
    d.way("Ostweg", "secondary", (120, 0), CENTRE, lanes="3", lanes__forward="2",
          lanes__backward="1", turn__lanes__forward="left|through;right", **PRIORITY)  # fmt: skip
    d.node(0, 10, **GIVE_WAY)
    d.way("Nordweg", "tertiary", (0, 120), (0, 10), CENTRE, lanes="2")
    d.node(0, -10, **GIVE_WAY)
    d.way("Südweg", "tertiary", (0, -120), (0, -10), CENTRE, lanes="3", lanes__forward="2",
          lanes__backward="1", turn__lanes__forward="left;through|right")  # fmt: skip


def placement(d: Drawing) -> None:
    """East of the junction the way runs where its turn lane parts from its through lane."""
    d.way("Westweg", "secondary", (-120, 0), CENTRE, lanes="2", **PRIORITY)
    d.way("Ostweg", "secondary", CENTRE, (120, 0), lanes="3", lanes__forward="1",
          lanes__backward="2", turn__lanes__backward="left|through",
          placement__backward="right_of:1", **PRIORITY)  # fmt: skip
    stem(d, lanes="2")


def centre_turn_lane(d: Drawing) -> None:
    tags = {"lanes": "3", "lanes__forward": "1", "lanes__backward": "1",
            "lanes__both_ways": "1", "turn__lanes__both_ways": "left"}  # fmt: skip
    d.arms("WE", "secondary", **tags)
    d.node(0, -9, highway="stop", direction="forward")
    d.way("South Road", "residential", (0, -120), (0, -9), CENTRE)


def change_lanes(d: Drawing) -> None:
    d.arms("W", "secondary", lanes="3", lanes__forward="2", lanes__backward="1",
           turn__lanes__forward="through|right", change__lanes__forward="not_right|not_left",
           **PRIORITY)  # fmt: skip
    d.arms("E", "secondary", lanes="2", **PRIORITY)
    stem(d, lanes="2")


def bus_lane(d: Drawing) -> None:
    d.way("Westweg", "secondary", (-120, 0), CENTRE, lanes="3", lanes__forward="2",
          lanes__backward="1", bus__lanes__forward="|designated",
          vehicle__lanes__forward="yes|no", **PRIORITY)  # fmt: skip
    d.way("Ostweg", "secondary", CENTRE, (120, 0), lanes="3", lanes__forward="2",
          lanes__backward="1", bus__lanes__forward="|designated",
          vehicle__lanes__forward="yes|no", **PRIORITY)  # fmt: skip
    stem(d, lanes="2")


def bicycle_lane(d: Drawing) -> None:
    d.arms("WE", "secondary", cycleway__both="lane", lanes="2", **PRIORITY)
    d.node(0, -9, **GIVE_WAY)
    d.way("Südweg", "tertiary", (0, -120), (0, -9), CENTRE, cycleway__right="track")


def parking_lanes(d: Drawing) -> None:
    d.arms("WE", "residential", parking__both="lane", parking__both__orientation="parallel")
    d.arms("S", "residential", parking__right="lane", parking__left="no")


def motorway_merge(d: Drawing) -> None:
    lanes = {"oneway": "yes", "lanes": "2"}
    d.way("A 1 West", "motorway", (-150, 0), CENTRE, **lanes)
    d.way("A 1 Ost", "motorway", CENTRE, (150, 0), oneway="yes", lanes="2")
    d.way("Auffahrt", "motorway_link", (-140, -45), (-60, -14), CENTRE, oneway="yes", lanes="1")


def motorway_diverge(d: Drawing) -> None:
    d.way("A 1 West", "motorway", (-150, 0), CENTRE, oneway="yes", lanes="3",
          turn__lanes="through|through|slight_right")  # fmt: skip
    d.way("A 1 Ost", "motorway", CENTRE, (150, 0), oneway="yes", lanes="2")
    d.way("Ausfahrt", "motorway_link", CENTRE, (60, -14), (140, -45), oneway="yes", lanes="1")


DRAWINGS = {
    "39_turn_lanes": turn_lanes,
    "40_placement": placement,
    "41_centre_turn_lane": (centre_turn_lane, OHIO),
    "42_change_lanes": change_lanes,
    "43_bus_lane": bus_lane,
    "44_bicycle_lane": bicycle_lane,
    "45_parking_lanes": parking_lanes,
    "46_motorway_merge": motorway_merge,
    "47_motorway_diverge": motorway_diverge,
}
