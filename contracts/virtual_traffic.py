"""Virtual traffic of a drive: what simulates it, and what it is told of the way ahead."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.drive import SignalState
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.numbers import MAX_SEED

TrafficSource = Literal["off", "model", "scenario", "sumo"]
MOST_COUNT = 500
"""Road users of one going simulation; a message may hold ten times as many."""

VIRTUAL_ROAD_USER = (
    "stamp_ns:int user_id:str kind:str lat_deg:float lon_deg:float yaw_rad:float speed_mps:float "
    "length_m:float width_m:float"
)
"""Columns of the table that says where virtual road users were."""


class VirtualTraffic(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Road users of one going simulation around the car, who exist nowhere else."""

    source: TrafficSource = "off"
    """What moves them: law-abiding drivers on the World's lanes (model), a scenario at each
    junction that it is for (scenario), or SUMO in a district (sumo)."""
    scenario: str = "cpta"
    """Of source scenario: an id of the catalogue, or a TOML file."""
    network: str | None = None
    """Of source sumo: the district as OpenDRIVE that foretwin wrote, or SUMO's .net.xml of it."""
    count: int = 20
    """So many there are; of source scenario those that it has."""
    seed: int | None = None
    """Of everything that is drawn; None is that of the drive."""

    def trouble(self) -> str | None:
        """Return what is wrong with it, None where nothing is."""
        if not 1 <= self.count <= MOST_COUNT:
            return f"count {self.count}: 1 to {MOST_COUNT}"
        if self.seed is not None and not 0 <= self.seed <= MAX_SEED:
            return f"seed {self.seed}: 0 to {MAX_SEED}"
        if self.source == "sumo" and self.network is None:
            return 'source sumo needs network = "FILE.xodr", as foretwin world --bbox writes it'
        return None


class TrafficCourse(msgspec.Struct, frozen=True, kw_only=True):
    """What virtual traffic is told before each round; its reply is the same message."""

    stamp_ns: int
    """The first stamp of the vehicle for which it counts."""
    start_stamp_ns: int
    """That of drive time 0, from which plans of lights count."""
    world_id: str | None
    """The World in force; None where there has been none."""
    path: PathAhead | None
    """Where the car will drive in it, from a little behind it on."""
    signals: tuple[SignalState, ...] = ()
    """Of lights, what was received last."""
    on: bool = True
    """Whether there is to be any traffic."""
