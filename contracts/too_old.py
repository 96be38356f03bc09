"""How old what is heard may be, and how late rounds may come: the drive goes by it, and displays
tell of it."""

from __future__ import annotations

STALE_S = 1.0
"""No round starts from a state older than this, in seconds of the drive's clock."""
LIGHT_FOR_S = 2.0
"""So long a light's colour counts; vehicles and roadside units repeat theirs at 1 Hz or more."""
USERS_FOR_NS = 500_000_000
"""Road users of whom nothing was said for so long are gone: from futures, from what virtual
sensors see and a vehicle is shown, and from displays."""
LATE_ROUNDS, OF_ROUNDS = 2, 4
"""So many late ones among the last rounds, and the next is smaller: one alone may be a World that
a worker has to load."""
