"""Every kind of TOML file that a user writes: its type, what its numbers may be, who reads it."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.anchor_file import AnchorFile, read_anchor
from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.field_words import fields_of
from foretwin.contracts.layout import LAYOUT_FILES, Layout, read_layout
from foretwin.contracts.numbers import FUTURE_NUMBERS, SCENARIO_NUMBERS, Range
from foretwin.contracts.scenario import ActorPart, EgoPart, FaultPart, Scenario
from foretwin.contracts.toml_file import load_toml
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator import config
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.sweep.spec import SweepSpec, load_spec
from foretwin.orchestrator.worlds import overpass
from foretwin.sim_worker.scenarios.reading import CATALOGUE, read_scenario
from foretwin.sim_worker.sensors.kinds import RANGES as SENSOR_KIND_RANGES
from foretwin.sim_worker.sensors.sensor_file import DEFAULT_FILE as SENSOR_FILE
from foretwin.sim_worker.sensors.sensor_file import RANGES as SENSOR_RANGES
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from foretwin.sim_worker.vehicle.parameters import DEFAULT_FILE as VEHICLE_FILE
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE
from foretwin.telemetry.logs.declaration import Declaration, read_declaration
from foretwin.telemetry.logs.map_origin import RecordingDeclaration, declared_of
from foretwin.telemetry.ros2.mapping import AUTOWARE, read_mapping
from foretwin.telemetry.ros2.mapping import Mapping as Ros2Mapping
from foretwin.telemetry.standin.parameters import DEFAULT_FILE as STANDIN_FILE
from foretwin.telemetry.standin.parameters import StandinParameters, read_parameters

_BLOCK = re.compile(r"```toml\n(.*?)```", re.DOTALL)

RANGES: Mapping[tuple[type, str], Range] = {
    **{(config.DriveConfig, name): one for name, one in config.RANGES.items()},
    **{(overpass.OverpassConfig, name): one for name, one in overpass.RANGES.items()},
    **{(SensorFile, name): one for name, one in SENSOR_RANGES.items()},
    **{
        (kind, name): one
        for kind, ranges in SENSOR_KIND_RANGES.items()
        for name, one in ranges.items()
    },
    **{(VehicleParameters, name): Range(*ends) for name, ends in PLAUSIBLE.items()},
    **{
        (part, name): row.range
        for part in (EgoPart, ActorPart)
        for name, row in SCENARIO_NUMBERS.items()
        if name in part.__struct_fields__
    },
    **{
        (FaultPart, name): row.range
        for name, row in FUTURE_NUMBERS.items()
        if name in FaultPart.__struct_fields__
    },
}
"""What a number of a file may be, by type and field; of a vehicle's parameter, its value."""
HIDDEN = frozenset({(config.DriveConfig, "towards_vehicle")})
"""Fields that no file may hold."""


class FileKind(NamedTuple):
    """A kind of file: what it is, its type, who reads it so that all is checked, and what an
    example of it begins with; `shipped` is an example that comes along, in its place."""

    what: str
    type: type[msgspec.Struct]
    read: Callable[[Path], object]
    begins: str = ""
    shipped: Path | None = None
    told_in: str | None = None
    """A module whose docstring has the example."""

    def example(self) -> str | None:
        """Return an example that somebody wrote, None where it is made of the type."""
        if self.shipped is not None:
            return self.shipped.read_text(encoding="utf-8")
        if self.told_in is None:
            return None
        found = _BLOCK.search(importlib.import_module(self.told_in).__doc__ or "")
        assert found is not None
        return found[1]


KINDS: Mapping[str, FileKind] = {
    "drive": FileKind(
        "settings of foretwin drive --config",
        config.DriveConfig,
        lambda path: load_config(path, {}),
    ),
    "sweep": FileKind(
        "what foretwin sweep plays",
        SweepSpec,
        lambda path: load_spec(path, start_stacks=False),
        begins='map = "MAP.osm"\nscenarios = ["ccftap", "scp"]\n',
    ),
    "scenario": FileKind(
        "a scenario, docs/scenarios.md",
        Scenario,
        read_scenario,
        shipped=CATALOGUE / "ccftap.toml",
    ),
    "vehicle": FileKind(
        "parameters of a vehicle, for --vehicle",
        VehicleParameters,
        load_vehicle,
        shipped=VEHICLE_FILE,
    ),
    "sensor": FileKind(
        "a sensor that does not exist, docs/sensors.md",
        SensorFile,
        load_sensor,
        shipped=SENSOR_FILE,
    ),
    "declaration": FileKind(
        "what the columns of a table are, NAME.csv.toml beside NAME.csv",
        Declaration,
        read_declaration,
        told_in="foretwin.telemetry.logs.declaration",
    ),
    "recording": FileKind(
        "what a recording of another program does not say of itself, NAME.mcap.toml",
        RecordingDeclaration,
        lambda path: declared_of(path.with_suffix(""), path),
        told_in="foretwin.telemetry.logs.map_origin",
    ),
    "ros2": FileKind(
        "how a live car's ROS 2 topics are read, for --ros2",
        Ros2Mapping,
        read_mapping,
        shipped=AUTOWARE,
    ),
    "standin": FileKind(
        "what the stand-in car is, for standin_parameters",
        StandinParameters,
        read_parameters,
        shipped=STANDIN_FILE,
    ),
    "anchor": FileKind(
        "which place of the World a car's lot is, for --anchor",
        AnchorFile,
        lambda path: read_anchor(path, first_pose=True),
        told_in="foretwin.contracts.anchor_file",
    ),
    "layout": FileKind(
        "how the viewer is laid out, for --layout",
        Layout,
        lambda path: read_layout(str(path)),
        shipped=LAYOUT_FILES / "drive.toml",
    ),
    "overpass": FileKind(
        "whom foretwin map get asks for maps",
        overpass.OverpassFile,
        overpass.load_overpass_config,
        begins='[overpass]\nendpoint = "https://overpass.example.org/api/interpreter"\n'
        'user_agent = "you@example.org"\n',
    ),
}
"""Every kind of file by its name."""


def kind_named(name: str) -> FileKind:
    """Return the kind of that name; raises UserError with those that there are."""
    if name not in KINDS:
        raise UserError(f"--kind {name}: {one_of(name, KINDS)}")
    return KINDS[name]


def kind_of(path: Path) -> str:
    """Return the kind that a file's keys fit best; raises UserError where they fit none."""
    values = load_toml(path, "file").values
    fits = {name: _fit(values, kind.type) for name, kind in KINDS.items()}
    best = [name for name, fit in fits.items() if fit == max(fits.values())]
    if values and not any(_known(KINDS[name], values) for name in best):
        raise UserError(f"{path}: no kind of file has such keys; --kind says which it is to be")
    return next((name for name in best if len(best) > 1 and _sound(name, path)), best[0])


def _sound(kind: str, path: Path) -> bool:
    """Whether a file can be used as one of a kind."""
    try:
        KINDS[kind].read(path)
    except (UserError, OSError):
        return False
    return True


def _known(kind: FileKind, values: Mapping[str, Any]) -> bool:
    return any(field.name in values for field in fields_of(kind.type))


def _fit(values: Mapping[str, Any], kind: type[msgspec.Struct]) -> float:
    fields = fields_of(kind)
    names = {field.name for field in fields}
    missing = sum(field.required and field.name not in values for field in fields)
    return len(names & set(values)) - len(set(values) - names) - 0.5 * missing
