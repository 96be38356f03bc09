"""What is known of the heights along a map's roads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.elevation import HeightProfile
from foretwin.world_gen.elevation.dem import DemSet


class RoadProfiles(NamedTuple):
    """Heights of a map's roads above the sea, by edge index, along the order of their nodes.

    `grade_std` is how far a grade is off.
    """

    dem: DemSet
    of_edge: Mapping[int, HeightProfile]
    grade_std: float
