"""What a recording of another program does not say of itself, declared in TOML beside it.

`NAME.toml`, after the whole name of the file or folder:

```toml
body_from_antenna_m = [1.4, 0.0, 1.6]  # where the recording has no static transforms
[map]                                  # origin of the frame `map`: a plane around it, x east
latitude = 52.5121
longitude = 13.3925
altitude = 34.0                        # of z = 0, above the ellipsoid
```
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.drive import Vector3
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.toml_file import load_toml
from foretwin.telemetry.logs.log import LogError

_Kind = TypeVar("_Kind", bound=msgspec.Struct)


class MapSection(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The origin of the frame `map`, degrees and metres on WGS84."""

    latitude: float
    """In degrees."""
    longitude: float
    """In degrees."""
    altitude: float = 0.0
    """Of z = 0, in metres above the ellipsoid."""


class RecordingDeclaration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What is declared of a recording."""

    body_from_antenna_m: Vector3 | None = None
    """Of the GNSS antenna from base_link, where no static transform tells."""
    map: MapSection | None = None
    """Origin of the frame `map`, a plane around it."""

    def frame(self) -> LocalFrame | None:
        """Return the plane of the frame `map`, None where it is not declared."""
        if self.map is None:
            return None
        return LocalFrame(GeoPoint(self.map.latitude, self.map.longitude, self.map.altitude))


def declared_of(path: Path, declaration: Path | None = None) -> RecordingDeclaration:
    """Return what `declaration`, else `NAME.toml` beside a recording, says; all is optional.

    Raises as `declaration_beside`, and LogError where the origin is no place on Earth.
    """
    found = declaration_beside(path, declaration, RecordingDeclaration)
    if found is None:
        return RecordingDeclaration()
    if (frame := found.frame()) is not None:
        try:
            frame.origin.validate()
        except ValueError as error:
            raise LogError(f"{declaration or _beside(path)}: [map] {error}") from None
    return found


def declaration_beside(path: Path, declaration: Path | None, kind: type[_Kind]) -> _Kind | None:
    """Return what `declaration`, else `NAME.toml` beside a log, declares; None where there is none.

    Raises FileNotFoundError for a declaration that was named and is not there, and LogError naming
    the field that is wrong.
    """
    file = declaration or _beside(path)
    if declaration is None and not file.is_file():
        return None
    return load_toml(file, "declaration", error=LogError).convert(kind)


def _beside(path: Path) -> Path:
    return path.with_name(path.name + ".toml")
