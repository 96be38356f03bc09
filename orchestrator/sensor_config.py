"""A drive's virtual sensors, `[[sensors]]`."""

from __future__ import annotations

import msgspec

from foretwin.contracts.setup import SensorSees


class SensorConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A sensor on the car that does not exist, docs/sensors.md."""

    file: str
    """A sensor file or the name of a bundled one, such as `vlp_16`."""
    sees: SensorSees = "world"
    """The World and its virtual road users, these alone (users), or a real cloud of the car, into
    which they are put (real)."""
