"""Who may go first: signals, signs and what the law says where there are none."""

from __future__ import annotations

from tests.data.junctions.draw_crossings import CENTRE, GIVE_WAY, carriageways
from tests.data.junctions.drawing import LEEDS, OHIO, Drawing

PRIORITY = {"priority_road": "designated"}


def signals_at_node(d: Drawing) -> None:
    d.arms("WES", "tertiary")
    d.node(0, 0, highway="traffic_signals")


def signals_on_approaches(d: Drawing) -> None:
    heads = {"highway": "traffic_signals", "traffic_signals__direction": "forward"}
    for x, y in ((0, 12), (12, 0), (0, -12), (-12, 0)):
        d.node(x, y, **heads)
    d.way("Westweg", "secondary", (-120, 0), (-12, 0), CENTRE, **PRIORITY)
    d.way("Ostweg", "secondary", (120, 0), (12, 0), CENTRE, **PRIORITY)
    d.way("Nordweg", "secondary", (0, 120), (0, 12), CENTRE, priority_road="end")
    d.way("Südweg", "secondary", (0, -120), (0, -12), CENTRE, priority_road="end")


def pedestrian_signals(d: Drawing) -> None:
    d.way("Westweg", "tertiary", (-120, 0), (-75, 0), CENTRE)
    d.node(-75, 0, highway="traffic_signals", crossing="traffic_signals")
    d.line((-75, 15), (-75, 0), (-75, -15), highway="footway", footway="crossing")
    d.arms("E", "tertiary")
    d.node(0, -8, **GIVE_WAY)
    d.way("Südweg", "residential", (0, -120), (0, -8), CENTRE)


def all_way_stop(d: Drawing) -> None:
    d.arms("NESW", "residential")
    d.node(0, 0, highway="stop", stop="all")


def minor_stop(d: Drawing) -> None:
    d.arms("WE", "secondary")
    for name, y in (("North Road", 1), ("South Road", -1)):
        d.node(0, 9 * y, highway="stop", stop="minor", direction="forward")
        d.way(name, "residential", (0, 120 * y), (0, 9 * y), CENTRE)


def bending_priority(d: Drawing) -> None:
    d.arms("WS", "tertiary", **PRIORITY)
    d.node(0, 9, **GIVE_WAY)
    d.way("Nordweg", "tertiary", (0, 120), (0, 9), CENTRE)
    d.node(9, 0, **GIVE_WAY)
    d.way("Ostweg", "tertiary", (120, 0), (9, 0), CENTRE)


def right_before_left(d: Drawing) -> None:
    d.arms("WES", "residential", maxspeed="30", source__maxspeed="DE:zone:30")


def near_side(d: Drawing) -> None:
    d.arms("NESW", "residential")


def turn_restrictions(d: Drawing) -> None:
    ways = d.arms("NESW", "residential")
    d.restriction("no_left_turn", ways["W"], CENTRE, ways["N"])
    d.restriction("only_straight_on", ways["N"], CENTRE, ways["S"])
    d.restriction("no_right_turn", ways["S"], CENTRE, ways["E"], **{"except": "motorcar"})


def restriction_via_way(d: Drawing) -> None:
    """No left turn out of the south and no U-turn out of the west, by way of the median."""
    carriageways(d)
    d.node(0, -16, **GIVE_WAY)
    south = d.way("Südweg", "secondary", (0, -120), (0, -16), (0, -7), lanes="2")
    link = d.way("", "secondary", (0, -7), (0, 7), lanes="2")
    d.node(0, 16, **GIVE_WAY)
    d.way("Nordweg", "secondary", (0, 120), (0, 16), (0, 7), lanes="2")
    west_in, west_out = 101, 104
    d.restriction("no_left_turn", south, link, west_out)
    d.restriction("no_u_turn", west_in, link, west_out)


def contraflow_for_bicycles(d: Drawing) -> None:
    d.arms("WE", "residential")
    d.arms("S", "residential", oneway="yes", oneway__bicycle="no")


def bridge_over(d: Drawing) -> None:
    t_with_give_way(d)
    d.way("Hochstraße", "secondary", (25, -120), (25, -60))
    d.way("Hochstraße", "secondary", (25, -60), (25, 60), bridge="yes", layer="1")
    d.way("Hochstraße", "secondary", (25, 60), (25, 120))


def tunnel_under(d: Drawing) -> None:
    d.arms("WES", "residential")
    d.way("Tunnelstraße", "secondary", (-90, 80), (90, -80), tunnel="yes", layer="-1")


def t_with_give_way(d: Drawing, highway: str = "tertiary", stem: str = "residential") -> None:
    d.arms("WE", highway)
    d.node(0, -8, **GIVE_WAY)
    d.way("Südweg", stem, (0, -120), (0, -8), CENTRE)


def service_roads(d: Drawing) -> None:
    d.way("Westweg", "residential", (-120, 0), (-55, 0), CENTRE)
    d.way("Ostweg", "residential", (120, 0), (55, 0), CENTRE)
    d.arms("S", "residential")
    d.way("", "service", (55, 0), (55, 25), service="driveway")
    d.way("", "service", (-55, 0), (-55, 40), service="parking_aisle")
    d.way("", "service", (0, -120), (40, -120))


def proving_ground(d: Drawing) -> None:
    t_with_give_way(d, "raceway", "raceway")


def tram_crossing(d: Drawing) -> None:
    t_with_give_way(d)
    d.node(0, 0, railway="tram_crossing")
    d.node(0, -8, railway="tram_crossing")
    d.line((3, -120), (0, -8), (0, 0), (0, 120), railway="tram")


def living_street(d: Drawing) -> None:
    d.arms("WE", "residential")
    d.arms("S", "living_street")


def left_hand_dual(d: Drawing) -> None:
    """The westbound carriageway lies south of the eastbound one, as traffic keeps left."""
    tags = {"oneway": "yes", "lanes": "2"}
    d.way("West Road", "primary", (-130, 7), (0, 7), **tags)
    d.way("East Road", "primary", (0, 7), (130, 7), **tags)
    d.way("East Road", "primary", (130, -7), (0, -7), **tags)
    d.way("West Road", "primary", (0, -7), (-130, -7), **tags)
    for name, y in (("North Road", 1), ("South Road", -1)):
        d.node(0, 15 * y, **GIVE_WAY)
        d.way(name, "secondary", (0, 120 * y), (0, 15 * y), (0, 7 * y), lanes="2")
    d.way("", "secondary", (0, 7), (0, -7), lanes="2")


def buses_alone(d: Drawing) -> None:
    d.way("Westweg", "residential", (-120, 0), (-50, 0), CENTRE)
    d.way("Ostweg", "residential", CENTRE, (50, 0), (120, 0))
    d.arms("S", "residential", motor_vehicle="no", bus="yes")
    d.way("Bustrasse", "busway", (50, 0), (50, 60))
    d.way("", "footway", (-50, 0), (-50, 40))


DRAWINGS = {
    "23_signals_at_node": signals_at_node,
    "24_signals_on_approaches": signals_on_approaches,
    "25_pedestrian_signals": pedestrian_signals,
    "26_all_way_stop": (all_way_stop, OHIO),
    "27_minor_stop": (minor_stop, OHIO),
    "28_bending_priority": bending_priority,
    "29_right_before_left": right_before_left,
    "30_left_hand_near_side": (near_side, LEEDS),
    "31_turn_restrictions": turn_restrictions,
    "32_restriction_via_way": restriction_via_way,
    "33_contraflow_for_bicycles": contraflow_for_bicycles,
    "34_bridge_over": bridge_over,
    "35_tunnel_under": tunnel_under,
    "36_service_roads": service_roads,
    "37_proving_ground": proving_ground,
    "38_tram_crossing": tram_crossing,
    "48_living_street": living_street,
    "49_left_hand_dual": (left_hand_dual, LEEDS),
    "50_buses_alone": buses_alone,
}
