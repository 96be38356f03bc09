"""The shapes of junctions: crossings, T and Y, dual carriageways, slip roads, many arms."""

from __future__ import annotations

import math

from tests.data.junctions.drawing import BERN, LEEDS, Drawing, Point

CENTRE: Point = (0.0, 0.0)
GIVE_WAY: dict[str, str] = {"highway": "give_way", "direction": "forward"}
STOP = {"highway": "stop", "direction": "forward"}


def at(bearing_deg: float, length_m: float = 120.0) -> Point:
    """Return a point at a bearing counter-clockwise from east."""
    angle = math.radians(bearing_deg)
    return (round(length_m * math.cos(angle), 2), round(length_m * math.sin(angle), 2))


def plain_crossing(d: Drawing) -> None:
    d.arms("NESW", "residential")


def staggered(d: Drawing) -> None:
    d.way("Westweg", "tertiary", (-130, 0), (-12, 0))
    d.way("Mitte", "tertiary", (-12, 0), (12, 0))
    d.way("Ostweg", "tertiary", (130, 0), (12, 0))
    d.node(-12, -9, **GIVE_WAY)
    d.way("Südweg", "residential", (-12, -120), (-12, -9), (-12, 0))
    d.node(12, 9, **GIVE_WAY)
    d.way("Nordweg", "residential", (12, 120), (12, 9), (12, 0))


def skewed(d: Drawing) -> None:
    d.arms("WE", "tertiary")
    d.node(*at(40, 14), **GIVE_WAY)
    d.way("Nordweg", "tertiary", at(40), at(40, 14), CENTRE)
    d.node(*at(220, 14), **GIVE_WAY)
    d.way("Südweg", "tertiary", at(220), at(220, 14), CENTRE)


def t_junction(d: Drawing) -> None:
    d.arms("WE", "tertiary")
    d.node(0, -8, **STOP)
    d.way("Südweg", "residential", (0, -120), (0, -8), CENTRE)


def y_junction(d: Drawing) -> None:
    d.way("Bergweg", "residential", at(90), CENTRE)
    d.way("Seeweg", "residential", at(210), CENTRE)
    d.way("Talweg", "residential", at(330), CENTRE)


def carriageways(d: Drawing, x_m: float = 0.0) -> None:
    """Draw a dual carriageway from west to east, cut at x: 2 lanes each way, 14 m apart."""
    tags = {"oneway": "yes", "lanes": "2", "priority_road": "designated"}
    d.way("Westring", "primary", (-130, -7), (x_m, -7), **tags)
    d.way("Ostring", "primary", (x_m, -7), (130, -7), **tags)
    d.way("Ostring", "primary", (130, 7), (x_m, 7), **tags)
    d.way("Westring", "primary", (x_m, 7), (-130, 7), **tags)


def dual_and_single(d: Drawing) -> None:
    carriageways(d)
    d.node(0, -7, highway="traffic_signals")
    d.node(0, 7, highway="traffic_signals")
    d.way("Südweg", "secondary", (0, -120), (0, -7), lanes="2")
    d.way("", "secondary", (0, -7), (0, 7), lanes="2")
    d.way("Nordweg", "secondary", (0, 120), (0, 7), lanes="2")


def dual_and_dual(d: Drawing) -> None:
    tags = {"oneway": "yes", "lanes": "2", "priority_road": "designated"}
    d.way("Westring", "primary", (-130, -7), (-7, -7), **tags)
    d.way("", "primary", (-7, -7), (7, -7), **tags)
    d.way("Ostring", "primary", (7, -7), (130, -7), **tags)
    d.way("Ostring", "primary", (130, 7), (7, 7), **tags)
    d.way("", "primary", (7, 7), (-7, 7), **tags)
    d.way("Westring", "primary", (-7, 7), (-130, 7), **tags)
    minor = {"oneway": "yes", "lanes": "2", "priority_road": "end"}
    d.way("Südring", "primary", (7, -130), (7, -7), **minor)
    d.way("", "primary", (7, -7), (7, 7), **minor)
    d.way("Nordring", "primary", (7, 7), (7, 130), **minor)
    d.way("Nordring", "primary", (-7, 130), (-7, 7), **minor)
    d.way("", "primary", (-7, 7), (-7, -7), **minor)
    d.way("Südring", "primary", (-7, -7), (-7, -130), **minor)
    for x in (-7, 7):
        for y in (-7, 7):
            d.node(x, y, highway="traffic_signals")


def split_mouth(d: Drawing) -> None:
    d.way("Westweg", "tertiary", (-120, 0), (-6, 0))
    d.way("Ostweg", "tertiary", (-6, 0), (6, 0), (120, 0))
    d.way("Südweg", "residential", (0, -120), (0, -25))
    d.node(5, -6, **GIVE_WAY)
    d.way("Südweg", "residential", (0, -25), (5, -6), (6, 0), oneway="yes")
    d.way("Südweg", "residential", (-6, 0), (-5, -6), (0, -25), oneway="yes")


def slip_lane(d: Drawing) -> None:
    d.way("Westweg", "secondary", (-120, 0), CENTRE)
    d.way("Ostweg", "secondary", CENTRE, (25, 0), (120, 0))
    d.node(0, -40, **GIVE_WAY)
    d.way("Südweg", "tertiary", (0, -120), (0, -40), (0, -25), CENTRE)
    d.way("", "tertiary_link", (0, -25), (4, -13), (12, -4), (25, 0), oneway="yes")


def slip_lane_gives_way(d: Drawing) -> None:
    d.way("Westweg", "secondary", (-120, 0), (-10, 0), CENTRE, priority_road="designated")
    d.way("Ostweg", "secondary", (120, 0), (25, 0), (10, 0), CENTRE, priority_road="designated")
    d.way("Südweg", "secondary", (0, -120), (0, -25), (0, -10), CENTRE, priority_road="end")
    for x, y in ((-10, 0), (10, 0), (0, -10)):
        d.node(x, y, highway="traffic_signals", traffic_signals__direction="forward")
    d.node(12, -4, **GIVE_WAY)
    d.way("", "secondary_link", (0, -25), (4, -13), (12, -4), (25, 0), oneway="yes")


def one_ways(d: Drawing) -> None:
    d.arms("WE", "residential")
    d.arms("S", "residential", oneway="yes")
    d.way("Nordweg", "residential", CENTRE, (0, 120), oneway="yes")


def five_arms(d: Drawing) -> None:
    d.arms("WE", "secondary", priority_road="designated")
    d.way("Nordweg", "residential", CENTRE, at(90), oneway="yes")
    d.way("Seeweg", "residential", CENTRE, at(225), oneway="yes")
    d.node(*at(315, 12), **GIVE_WAY)
    d.way("Talweg", "residential", at(315), at(315, 12), CENTRE, oneway="yes")


def six_arms(d: Drawing) -> None:
    d.arms("WE", "secondary", priority_road="designated")
    d.way("Amselweg", "residential", CENTRE, at(60), oneway="yes")
    d.way("Drosselweg", "residential", CENTRE, at(300), oneway="yes")
    for name, bearing in (("Birkenweg", 120), ("Caspariweg", 240)):
        d.node(*at(bearing, 12), **GIVE_WAY)
        d.way(name, "residential", at(bearing), at(bearing, 12), CENTRE, oneway="yes")


def left_hand_crossing(d: Drawing) -> None:
    d.arms("WE", "secondary")
    for name, y in (("North Road", 1), ("South Road", -1)):
        d.node(0, 8 * y, **GIVE_WAY)
        d.way(name, "tertiary", (0, 120 * y), (0, 8 * y), CENTRE)


def u_turn_link(d: Drawing) -> None:
    carriageways(d)
    d.node(0, -16, **GIVE_WAY)
    d.way("Südweg", "tertiary", (0, -120), (0, -16), (0, -7))
    d.node(0, 2, **GIVE_WAY)
    d.way("", "primary_link", (0, -7), (0, 2), (0, 7), oneway="yes")


def dead_end_nearby(d: Drawing) -> None:
    d.arms("WE", "residential")
    d.way("Südweg", "residential", (0, -40), CENTRE)
    d.node(0, -40, noexit="yes")


DRAWINGS = {
    "01_plain_crossing": plain_crossing,
    "02_staggered": staggered,
    "03_skewed": skewed,
    "04_t_junction_stop": t_junction,
    "05_y_junction": (y_junction, BERN),
    "06_dual_and_single": dual_and_single,
    "07_dual_and_dual": dual_and_dual,
    "08_split_mouth": split_mouth,
    "09_slip_lane": slip_lane,
    "10_slip_lane_gives_way": slip_lane_gives_way,
    "11_one_ways": one_ways,
    "12_five_arms": five_arms,
    "13_left_hand_crossing": (left_hand_crossing, LEEDS),
    "14_six_arms": six_arms,
    "15_u_turn_link": u_turn_link,
    "16_dead_end_nearby": dead_end_nearby,
}
