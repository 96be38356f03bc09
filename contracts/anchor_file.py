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

Without `[lot]` the car's first settled pose is it.
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

    world: AnchorPose
    """Where that is in the World: a pose on a lane."""
    lot: AnchorPose | None = None
    """Where the vehicle really is; without it, where a drive first finds it settled."""
    scale: float = 1.0
    """Metres in the World for a metre on the lot: 10 for a car of 1:10."""
    mirrored: bool = False
    """Whether left on the lot is right in the World, for traffic of the other side."""
    fence: tuple[tuple[float, float], ...] = ()
    """Corners of the lot, degrees of latitude and longitude: outside, nothing goes to the car."""

    @property
    def anchor(self) -> Anchor:
        """The transform alone; ValueError where no lot is known yet."""
        if self.lot is None:
            raise ValueError("lot: not known before the car's first settled pose")
        return Anchor(lot=self.lot, world=self.world, scale=self.scale, mirrored=self.mirrored)

    def at_lot(self, lot: AnchorPose) -> AnchorFile:
        """Return the same with its lot; raises UserError where that lies outside of the fence."""
        file = msgspec.structs.replace(self, lot=lot)
        try:
            file.validate()
        except ValueError as wrong:
            raise UserError(f"first pose {lot.lat_deg:.7f}, {lot.lon_deg:.7f}: {wrong}") from wrong
        return file

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        lot = self.world if self.lot is None else self.lot
        msgspec.structs.replace(self, lot=lot).anchor.validate()
        if not self.fence:
            return
        if not 3 <= len(self.fence) <= _MOST_CORNERS:
            raise ValueError(f"fence: {len(self.fence)} corners; 3 to {_MOST_CORNERS} are needed")
        if not all(abs(lat) < 90.0 and abs(lon) <= 180.0 for lat, lon in self.fence):
            raise ValueError("fence: corners are [latitude, longitude] in degrees")
        ring = shapely.Polygon(self.fence)
        if not ring.is_valid:  # nor is one without an area
            raise ValueError("fence: its sides cross; name the corners in order")
        if self.lot is None:
            return
        if not ring.contains(shapely.Point(self.lot.lat_deg, self.lot.lon_deg)):
            raise ValueError("fence: the lot's own point lies outside")


def read_anchor(path: Path, *, first_pose: bool = False) -> AnchorFile:
    """Read and check an anchor file; `first_pose` says that its lot may still be unknown.

    Raises UserError or FileNotFoundError, one line.
    """
    file = read_toml(path, AnchorFile, what="anchor", check=AnchorFile.validate, error=UserError)
    if file.lot is None and not first_pose:
        raise UserError(f"{path}: [lot] is missing: the first pose is asked of a drive's own car")
    return file


def anchor_text(file: AnchorFile) -> str:
    """Return an anchor file as TOML, to the last digit."""
    lines = [f"scale = {file.scale!r}", f"mirrored = {str(file.mirrored).lower()}"]
    if file.fence:
        lines.append(f"fence = [{', '.join(f'[{lat!r}, {lon!r}]' for lat, lon in file.fence)}]")
    for name, pose in (("lot", file.lot), ("world", file.world)):
        if pose is not None:
            values = msgspec.to_builtins(pose)
            lines += ["", f"[{name}]", *(f"{key} = {value!r}" for key, value in values.items())]
    return "\n".join(lines) + "\n"
