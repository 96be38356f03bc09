"""The file that anchors a drive: where the lot lies, how far it goes, what it is in the World.

```toml
scale = 1.0                     # metres in the World for one on the lot
mirrored = false
fence = [[52.47435, 13.38700], [52.47495, 13.41900], [52.47330, 13.41910], [52.47270, 13.38710]]

[lot]
lat_deg = 52.47390
lon_deg = 13.39500
yaw_deg = -2.0                  # counter-clockwise from true east

[world]
lat_deg = 52.51130
lon_deg = 13.38900
yaw_deg = 8.0
```
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import shapely

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.errors import UserError
from foretwin.contracts.toml_file import read_toml

_MOST_CORNERS = 1000


class AnchorFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file."""

    lot: AnchorPose
    """Where the vehicle really is."""
    world: AnchorPose
    """Where that is in the World."""
    scale: float = 1.0
    """Metres in the World for a metre on the lot: 10 for a car of 1:10."""
    mirrored: bool = False
    """Whether left on the lot is right in the World, for traffic of the other side."""
    fence: tuple[tuple[float, float], ...] = ()
    """Corners of the lot, degrees of latitude and longitude: outside, nothing goes to the car."""

    @property
    def anchor(self) -> Anchor:
        """The transform alone."""
        return Anchor(lot=self.lot, world=self.world, scale=self.scale, mirrored=self.mirrored)

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        self.anchor.validate()
        if not self.fence:
            return
        if not 3 <= len(self.fence) <= _MOST_CORNERS:
            raise ValueError(f"fence: {len(self.fence)} corners; 3 to {_MOST_CORNERS} are needed")
        if not all(abs(lat) < 90.0 and abs(lon) <= 180.0 for lat, lon in self.fence):
            raise ValueError("fence: corners are [latitude, longitude] in degrees")
        ring = shapely.Polygon(self.fence)
        if not ring.is_valid or ring.area == 0.0:
            raise ValueError("fence: its sides cross; name the corners in order")
        if not ring.contains(shapely.Point(self.lot.lat_deg, self.lot.lon_deg)):
            raise ValueError("fence: the lot's own point lies outside")


def read_anchor(path: Path) -> AnchorFile:
    """Read and check an anchor file; raises UserError or FileNotFoundError, one line."""
    return read_toml(path, AnchorFile, what="anchor", check=AnchorFile.validate, error=UserError)
