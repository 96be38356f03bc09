"""Scenarios: what could happen at a junction, written down without naming any junction.

A `Scenario` is abstract: relations instead of places, spans instead of numbers. Sides are named
by the traffic: `near` is where one drives (right where traffic keeps right), `across` the other.
Every number of one of its cases has a name: `ego.speed_mps`, `<actor>.gap_m`,
`faults.friction_factor` and so on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import msgspec

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.world import Control, JunctionKind

TrafficTurn = Literal["straight", "across", "near"]
"""Through a junction: straight on, across oncoming traffic, or to the side where one drives."""
_FromArm = Literal["oncoming", "from_near", "from_across"]
_AlongPath = Literal["ahead", "behind", "beside"]
_AcrossArm = Literal["crosses_exit", "crosses_entry"]
Relation = Literal[_FromArm, _AlongPath, "on_ring", "joins_ring", _AcrossArm, "parked"]
"""Where a road user comes from, as the ego sees it.

`oncoming` from the opposite arm, `from_near` and `from_across` from the side arms, `ahead`,
`behind` and `beside` (on the near side) along the ego's own path, `on_ring` circulates where the
ego enters, `joins_ring` enters where the ego circulates, `crosses_exit` and `crosses_entry` on
foot or wheels over the arm that the ego leaves or enters by, `parked` beside its path.
"""
Conduct = Literal["heedless", "law_abiding", "stops", "parked", "overtakes"]
"""`heedless` keeps its speed whatever happens, but in bends that ask for less, `law_abiding`
follows, waits and gives way, `stops` keeps its speed, then brakes, `parked` stands, `overtakes`
passes who is slower."""
Setting = Literal["junction", "road", "motorway", "circuit", "parking_bay"]

EGO = "ego"
FAULTS = "faults"


class Distribution(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a number may be: one of `values`, or uniform from `min` to `max`, or, with `mean` and
    `std`, normal and cut to `min` and `max` where these are given."""

    values: tuple[float, ...] = ()
    """One of these, each as often as the others."""
    min: float | None = None
    """The least."""
    max: float | None = None
    """The most."""
    mean: float | None = None
    """Of a normal distribution."""
    std: float | None = None
    """Its standard deviation, above 0."""


Number = float | Distribution
"""A number that is always the same, or one that differs from case to case."""


class EgoPart(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the car under test does when nobody intervenes."""

    turn: TrafficTurn = "straight"
    """Where it goes at the junction."""
    speed_mps: Number = 8.33
    """At which it drives where nothing slows it down."""
    lateral_shift_m: Number = 0.0
    """How far to the left of its lane it aims."""
    reverse: bool = False
    """Whether it goes backwards."""


class ActorPart(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Another road user.

    Without intervention it touches the ego `arrives_after_s` later than meant: 0 is an impact.
    `impact_share` says where on the ego's front, from 0 at its near side to 1. `gap_m` is from
    bumper to bumper along the ego's path (`ahead`, `behind`, `parked`), `lateral_m` to the across
    side of that path. Who `stops` does so `acts_after_s` with `decel_mps2`. Who crosses an arm
    goes to the side that `turn` names, or to either where it is `straight`; who is parked and
    hides another stands `gap_m` before the other's line.
    """

    name: str
    """What its numbers are called after: lower-case letters, digits and _."""
    relation: Relation
    """Where it comes from, as the ego sees it."""
    kind: RoadUserKind = "car"
    """What it is, which says how large and heavy it is."""
    turn: TrafficTurn = "straight"
    """Where it goes at the junction."""
    speed_mps: Number = 8.33
    """At which it drives where nothing slows it down."""
    conduct: Conduct = "heedless"
    """Whether it minds others."""
    impact_share: Number = 0.5
    """Where on the ego's front it touches, from 0 at its near side to 1."""
    arrives_after_s: Number = 0.0
    """So much later than meant for an impact it comes."""
    gap_m: Number = 20.0
    """From bumper to bumper along the ego's path."""
    lateral_m: Number = 0.0
    """To the across side of the ego's path."""
    acts_after_s: Number = 0.0
    """When it brakes, if it does."""
    decel_mps2: Number = 4.0
    """With which it brakes."""
    hidden_by: str = ""
    """Name of another actor behind which this one stays unseen until it comes out."""


if TYPE_CHECKING:

    class FaultPart(msgspec.Struct, frozen=True):
        """What is wrong with the car under test, or with the ground below it."""

else:
    _faults = [
        (name, Number, row.neutral) for name, row in FUTURE_NUMBERS.items() if row.part == "fault"
    ]
    FaultPart = msgspec.defstruct(
        "FaultPart", _faults, frozen=True, kw_only=True, forbid_unknown_fields=True, module=__name__
    )


class Where(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which places a scenario is for; an empty list admits all."""

    setting: Setting = "junction"
    """What kind of place."""
    kinds: tuple[JunctionKind, ...] = ()
    """Kinds of junctions; none named admits all."""
    controls: tuple[Control, ...] = ()
    """How the ego is controlled there; none named admits all."""


class Scenario(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One entry of the catalogue, as its TOML file states it; `source` names who defined it."""

    id: str
    """Lower-case letters, digits and _."""
    title: str
    """In a few words what it is."""
    shows: str
    """What one sees when it runs, in one sentence."""
    source: str
    """Who defined it."""
    where: Where = Where()
    """Which places it is for."""
    ego: EgoPart = EgoPart()
    """What the car under test does."""
    actors: tuple[ActorPart, ...] = ()
    """Other road users."""
    faults: FaultPart = FaultPart()
    """What is wrong with the car or the ground."""
    horizon_s: float = 8.0
    """How long a case is played, 0.5 to 60."""
    lead_time_s: float = 4.0
    """From the start to the planned impact."""
    seed: int = 0
    """Of what is drawn."""
    samples: int = 1
    """How many cases to draw for each combination of listed values."""
