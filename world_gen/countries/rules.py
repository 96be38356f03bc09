"""What holds in a country where a map does not say: speeds, lane widths, who goes first, lights.

One row a country, each value with its unit in its name and its law or norm in `source`. What a
World takes from here is a `default`, since the map does not say it. A country without a row, and
what a row leaves out, is that of `CountryRules` itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.world import DrivingSide

_MPH = 1.609344
_RED_AMBER_S = 1.0
"""RiLSA 2015 2.4; of other countries that show it, too, where their law names no length."""


class CountryRules(NamedTuple):
    """What is usual in a country; the defaults are Germany's widths and what most countries have.

    Speeds in km/h are the limits by law without a sign. Lane widths are by class of road; of
    classes that are not named those of `road_classes.ROAD_CLASSES` hold (RAA 2008, RAL 2012,
    RASt 06).
    """

    source: str = "the rule of most countries (Vienna Convention on Road Traffic, 1968)"
    town_kmph: float = 50.0
    local_kmph: float = 50.0
    """Of residential streets."""
    rural_kmph: float = 80.0
    dual_kmph: float = 100.0
    """Of roads outside towns that are for motor vehicles alone, or whose directions are apart."""
    motorway_kmph: float = 120.0
    living_street_kmph: float = 10.0
    lane_width_m: Mapping[str, float] = {}
    first_from: DrivingSide | None = None
    """The side from which who comes goes first among equals; None: the near side, that of
    driving (Vienna Convention art. 18 (4))."""
    all_way_stops: bool = False
    """Whether a stop sign that stands on a junction's own node stops all roads (MUTCD 2B.07)."""
    red_amber_s: float = 0.0
    """How long red and amber show together before green; 0 where green follows red."""
    turn_on_red: bool = False
    """Whether a turn to the near side may go on red after a stop, unless a sign forbids it."""
    mixed_corner_m: float = 10.0
    """Radius of the road's edge at a right angle between a main road and a lesser one: between
    RASt 06's 12 m out of the main one and its 8 m into it, as lanes of both end at one place."""

    def width_m(self, road_class: str, usual_m: float) -> float:
        """Return the usual width of a lane on a road of this class."""
        return self.lane_width_m.get(road_class, usual_m)


def _widths(wide_m: float, main_m: float, minor_m: float, local_m: float) -> Mapping[str, float]:
    """Return widths by class: fast roads, primary, secondary and tertiary, streets."""
    return {
        **dict.fromkeys(("motorway", "motorway_link", "trunk", "trunk_link"), wide_m),
        **dict.fromkeys(("primary", "primary_link"), main_m),
        **dict.fromkeys(("secondary", "secondary_link", "tertiary", "tertiary_link"), minor_m),
        **dict.fromkeys(("unclassified", "residential"), local_m),
    }


_AT = CountryRules(
    "StVO 1960 §20 (2), §38; §76b", 50, 50, 100, 100, 130, 7, red_amber_s=_RED_AMBER_S
)
_CH = CountryRules(
    "VRV art. 4a, 22b; SSV art. 68", 50, 50, 80, 100, 120, 20, red_amber_s=_RED_AMBER_S
)
_CZ = CountryRules(
    "361/2000 Sb. §18, §39; 294/2015 Sb.", 50, 50, 90, 110, 130, 20, red_amber_s=_RED_AMBER_S
)
_DE = CountryRules(
    "StVO §3 (3), §37, zones of 30 km/h §45 (1c); BAB-RichtgeschwV; RiLSA 2015 2.4",
    *(50, 30, 100, 100, 130, 7),
    red_amber_s=_RED_AMBER_S,
)
_DK = CountryRules("Færdselsloven §42; BEK 1193", 50, 50, 80, 80, 130, 15, red_amber_s=_RED_AMBER_S)
_FR = CountryRules(
    "Code de la route R413-2, R413-3, R110-2, R415-5; ICTAAL 2015 for motorways",
    *(50, 50, 80, 110, 130, 20),
    lane_width_m={"motorway": 3.5},
)
_GB = CountryRules(
    "Highway Code 124, 146; TSRGD 2016 schedule 14; DMRB CD 127; Manual for Streets 7.2",
    *(30 * _MPH, 30 * _MPH, 60 * _MPH, 70 * _MPH, 70 * _MPH, 20 * _MPH),
    lane_width_m=_widths(3.65, 3.65, 3.0, 2.75),
    red_amber_s=2.0,
)
_US = CountryRules(
    "UVC 11-801.1 (30 and 55 mph), 11-202, 11-401; 25 mph in residence districts (CVC 22352); "
    "MUTCD 2B.07; AASHTO Green Book 2018 (12 ft, on lesser streets 10 and 11 ft; corners of 20 ft "
    "with tapers beside them)",
    *(30 * _MPH, 25 * _MPH, 55 * _MPH, 65 * _MPH, 65 * _MPH, 10 * _MPH),
    lane_width_m=_widths(3.66, 3.66, 3.35, 3.05),
    all_way_stops=True,
    turn_on_red=True,
    mixed_corner_m=6.0,
)
_AU = CountryRules(
    "Australian Road Rules 20, 25, 72; Austroads AGRD part 3",
    *(50, 50, 100, 100, 110, 10),
    lane_width_m=_widths(3.5, 3.5, 3.3, 3.0),
    first_from="right",
)

COUNTRIES: Mapping[str, CountryRules] = {
    "AT": _AT,
    "AU": _AU,
    "BE": CountryRules(
        "Code de la route art. 11 (70 in Flanders, 90 in Wallonia), 22bis", 50, 50, 70, 120, 120, 20
    ),
    "BR": CountryRules("CTB art. 61 (local 30, collector 40, arterial 60)", 60, 30, 100, 110, 110),
    "CA": CountryRules(
        "HTA Ontario s. 128, 144; MVA British Columbia s. 146; TAC Geometric Design Guide 2017",
        *(50, 50, 80, 90, 100),
        lane_width_m=_widths(3.7, 3.5, 3.3, 3.0),
        all_way_stops=True,
        turn_on_red=True,
    ),
    "CH": _CH,
    "CN": CountryRules(
        "Implementing Regulations of the Road Traffic Safety Law art. 38, 45, 78; JTG B01",
        *(50, 30, 70, 100, 120),
        lane_width_m={"motorway": 3.75},
        turn_on_red=True,
    ),
    "CZ": _CZ,
    "DE": _DE,
    "DK": _DK,
    "ES": CountryRules("RGC art. 48, 50 (30 on streets of one lane)", 50, 30, 90, 90, 120, 20),
    "FI": CountryRules(
        "Tieliikennelaki 729/2018, asetus 2.3", 50, 50, 80, 80, 120, 20, red_amber_s=_RED_AMBER_S
    ),
    "FR": _FR,
    "GB": _GB,
    "GR": CountryRules("KOK art. 20", 50, 50, 90, 110, 130, 20),
    "HK": CountryRules("Road Traffic Ordinance s. 40", 50, 50, 50, 70, 80, red_amber_s=2.0),
    "HR": CountryRules("ZSPC art. 53, 54", 50, 50, 90, 110, 130, 10, red_amber_s=_RED_AMBER_S),
    "HU": CountryRules("KRESZ 26. §, 9. §", 50, 50, 90, 110, 130, 20, red_amber_s=_RED_AMBER_S),
    "IE": CountryRules(
        "Road Traffic Act 2004 s. 5 to 8", 50, 50, 80, 100, 120, lane_width_m={"motorway": 3.75}
    ),
    "IN": CountryRules(
        "Motor Vehicles Act s. 112, S.O. 1522(E) 2018", 70, 50, 70, 100, 120, first_from="right"
    ),
    "IT": CountryRules("Codice della strada art. 142; DM 6792/2001", 50, 50, 90, 110, 130, 10),
    "JP": CountryRules(
        "Road Traffic Act Enforcement Order art. 11 (2026: 30 without a centre line), 27; "
        "Road Structure Ordinance art. 5",
        *(60, 30, 60, 60, 100),
        lane_width_m=_widths(3.5, 3.25, 3.0, 3.0),
    ),
    "KR": CountryRules(
        "Road Traffic Act Enforcement Rule art. 6, 19", 50, 50, 60, 80, 100, turn_on_red=True
    ),
    "LI": _CH._replace(source="VRV (Liechtenstein) art. 4a; the lights of its neighbour"),
    "LU": CountryRules("Code de la route art. 139", 50, 50, 90, 90, 130, 20),
    "MC": _FR._replace(
        source="Monaco is all town: 50; else its neighbour's", rural_kmph=50.0, dual_kmph=70.0
    ),
    "MX": CountryRules("Ley General de Movilidad art. 49", 50, 30, 80, 80, 110, all_way_stops=True),
    "NL": CountryRules("RVV 1990 art. 20 to 22, 45", 50, 50, 80, 100, 130, 15, {"motorway": 3.5}),
    "NO": CountryRules(
        "Vegtrafikkloven §6; skiltforskriften §24",
        50,
        50,
        80,
        80,
        110,
        10,
        red_amber_s=_RED_AMBER_S,
    ),
    "NZ": CountryRules(
        "Land Transport (Road User) Rule 2004 4.2; Setting of Speed Limits Rule 2024",
        *(50, 50, 100, 100, 100),
        lane_width_m={"motorway": 3.5},
        first_from="right",
    ),
    "PL": CountryRules(
        "Prawo o ruchu drogowym art. 20", 50, 50, 90, 120, 140, 20, red_amber_s=_RED_AMBER_S
    ),
    "PT": CountryRules("Código da Estrada art. 27", 50, 50, 90, 100, 120, 20),
    "SE": CountryRules(
        "Trafikförordningen 3 kap. 17 §; VMF 3 kap.",
        50,
        50,
        70,
        90,
        110,
        7,
        red_amber_s=_RED_AMBER_S,
    ),
    "SI": CountryRules("ZPrCP art. 46", 50, 50, 90, 110, 130, 10, red_amber_s=_RED_AMBER_S),
    "SK": CountryRules(
        "8/2009 Z. z. §16; 30/2020 Z. z.", 50, 50, 90, 90, 130, 20, red_amber_s=_RED_AMBER_S
    ),
    "US": _US,
    "ZA": CountryRules(
        "NRTR 292; four-way stops NRTR 287", 60, 60, 100, 100, 120, all_way_stops=True
    ),
}
"""By code of ISO 3166-1 alpha-2."""
_LIKE = {
    **dict.fromkeys(("GG", "IM", "JE"), "GB"),
    **dict.fromkeys(("AS", "GU", "MP", "PR", "VI"), "US"),
    **dict.fromkeys(("GF", "GP", "MQ", "RE", "YT"), "FR"),
}
"""Territories with a code of their own whose roads are ruled as another country's."""
_REST = CountryRules(local_kmph=30.0)


def rules_of(code: str) -> CountryRules:
    """Return the rules of a country by its code, those of most countries where it has no row."""
    return COUNTRIES.get(_LIKE.get(code, code), _REST)
