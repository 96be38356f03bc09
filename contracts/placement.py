"""Where scenarios can take place: in a World, or around a car that was recorded there."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import ATTRIBUTION

AS_RECORDED = "as_recorded"
"""Id of the scenario that adds nobody to those who were around a recorded car."""


class PlacedHere(msgspec.Struct, frozen=True, kw_only=True):
    """A place that a scenario has in a World; `ego` names the way that the ego takes."""

    scenario_id: str
    junction_id: str
    place: str
    ego: str
    start: int | None = None
    """Of the recorded starts, which; None where the case says where the ego starts."""
    rank: int = 0
    """Which of the places that fit the way of a recorded car."""


class NotPlaced(msgspec.Struct, frozen=True, kw_only=True):
    """A junction without a place for a scenario that applies to it, or for a whole one."""

    scenario_id: str
    junction_id: str
    reason: str
    applies: bool


class WorldPlaces(msgspec.Struct, frozen=True, kw_only=True):
    """Where scenarios take place in one World."""

    world_id: str
    frame: LocalFrame
    placed: tuple[PlacedHere, ...]
    unplaced: tuple[NotPlaced, ...]
    ways: dict[str, PathAhead] = {}
    """Those that staged egos take, by name."""
    attribution: str = ATTRIBUTION


class RecordedStart(msgspec.Struct, frozen=True, kw_only=True):
    """Where the car was as a round began, and the way that it then drove, in degrees."""

    round_id: int
    drive_time_s: float
    world_id: str
    junction_id: str
    cruise_speed_mps: float
    state: VehicleState
    lat_deg: tuple[float, ...]
    lon_deg: tuple[float, ...]

    def path(self, frame: LocalFrame) -> PathAhead:
        """Return the way that the car drove in a World's frame; of limits nothing is known."""
        xy = np.asarray(local_from_geo(frame, np.array(self.lat_deg), np.array(self.lon_deg)))
        return PathAhead(xy_m=xy, speed_limit_mps=np.full(len(xy), np.inf))


class PlaceRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Where do these scenarios take place in this World, for the vehicle of this digest?

    At most `most` places of a scenario at one junction, or on one recorded way: with `starts`, by
    their numbers, only what can happen on these counts.
    """

    world_id: str
    scenarios: tuple[Scenario, ...]
    vehicle: str
    most: int
    starts: tuple[tuple[int, RecordedStart], ...] = ()
