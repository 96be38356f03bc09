"""One list of what the car really sees and what only the simulation holds, for its own stack.

It goes out as the car's own list comes in, once for each, with that list's stamp and header: what
the car's perception said of each object stays as it was, and where perception is silent nothing is
said either.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.telemetry.mixed.merge import MergeRules, merge, viewpoint
from foretwin.telemetry.ros_messages.objects import ObjectSpread

MOST_REAL = 512
"""Real ones beyond so many are passed on, and not compared with virtual ones: none is added."""


class HeardObjects(NamedTuple):
    """A list of objects as it came from the car, and the ids of those that only come back."""

    ros: Any
    echoes: frozenset[str] = frozenset()


class MergedList(NamedTuple):
    """The car's own list, ids of what is left out of it, and what is added."""

    real: HeardObjects
    without: frozenset[str]
    virtual: RoadUsers
    spread: ObjectSpread


class MergedObjects:
    """Merges each list of the car; `counts` says what became of virtual road users."""

    def __init__(self, rules: MergeRules, *, frame: LocalFrame) -> None:
        self._rules, self._frame = rules, frame
        self._state: VehicleState | None = None
        self.counts: Counter[str] = Counter()

    def take_state(self, state: VehicleState) -> None:
        """Take where the car is."""
        self._state = state

    def merged(self, real: RoadUsers, virtual: RoadUsers, heard: HeardObjects) -> MergedList:
        """Return one list; `real` is what `heard` says without its echoes, all at one stamp.

        Where nothing can be added the car's own list is passed on.
        """
        rules, state = self._rules, self._state
        spread = ObjectSpread(rules.position_std_m, rules.yaw_std_rad, rules.speed_std_mps)
        knows = state is not None and abs(state.stamp_ns - real.stamp_ns) <= USERS_FOR_NS
        if state is None or not knows or len(real.users) > MOST_REAL:
            why = "not added to a list too long" if knows else "not added without the car's place"
            self.counts[why] += len(virtual.users)
            nobody = RoadUsers(stamp_ns=real.stamp_ns, users=())
            return MergedList(heard, heard.echoes, nobody, spread)
        view = viewpoint(state, self._frame, rules, stamp_ns=real.stamp_ns)
        found = merge(real.users, virtual.users, view, rules, self._frame)
        hidden = frozenset(real.users[place].user_id for place in found.hidden_real)
        self.counts["added"] += len(found.virtual)
        self.counts["are real ones"] += found.coincide
        self.counts["not seen"] += found.not_seen
        self.counts["real ones hidden"] += len(hidden)
        added = RoadUsers(stamp_ns=real.stamp_ns, users=found.virtual)
        return MergedList(heard, heard.echoes | hidden, added, spread)
