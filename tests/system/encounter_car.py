"""A stand-in car that meets others on purpose, by a clock of its own, and says where it truly was:
`python -m tests.system.encounter_car --setup FILE` (`StandinSetup`).

It heeds nobody. It sets off at the instant of the monotonic clock that stands in the file
MEETS_FROM, its clock is MEETS_AHEAD_S of the others', and it writes MEETS_TRUTH/ID.json as it ends.

`python -m tests.system.encounter_car join ID …` is `foretwin join` with such a car as its stand-in.
"""

from __future__ import annotations

import functools
import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.anchor import AnchorLine
from foretwin.contracts.bus import Bus
from foretwin.contracts.frames import geo_from_local, geo_from_local_yaw
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import StandinSetup
from foretwin.telemetry.processes.vehicle_process import VehicleProcess
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath, read_path
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource

FROM, AHEAD_S, TRUTH = "MEETS_FROM", "MEETS_AHEAD_S", "MEETS_TRUTH"
THERE = ".there"
"""The end of the name of a file beside its truth, which it makes once it is on the bus."""
PATH = "MEETS_PATH"
"""What it drives; its setup's path is passed over."""


class _Noted(StandinSource):
    """Notes its true pose as often as its gyro measures."""

    def __init__(self, path: DrivenPath, *args: Any, **options: Any) -> None:
        super().__init__(path, *args, **options)
        self.frame = path.frame
        self.poses: list[tuple[int, float, float, float]] = []

    def _sample(self, channel: str, stamp_ns: int, motion: Any) -> Any:
        if channel == "imu":
            self.poses.append((stamp_ns, motion.x_m, motion.y_m, motion.yaw_rad))
        return super()._sample(channel, stamp_ns, motion)


class _Ahead:
    """A source by another clock; see VehicleSource."""

    def __init__(self, source: StandinSource, ahead_ns: int) -> None:
        self._source, self._ahead_ns = source, ahead_ns
        self.first_stamp_ns = source.first_stamp_ns + ahead_ns
        self.info = msgspec.structs.replace(source.info, start_stamp_ns=self.first_stamp_ns)
        self.skipped_invalid = 0

    @property
    def next_stamp_ns(self) -> int:
        return self._source.next_stamp_ns + self._ahead_ns

    @property
    def ended(self) -> bool:
        return self._source.ended

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        for channel, message in self._source.advance(until_stamp_ns - self._ahead_ns):
            stamp_ns = message.stamp_ns + self._ahead_ns
            yield channel, msgspec.structs.replace(message, stamp_ns=stamp_ns)


class _Punctual(VehicleProcess):
    """Sets off when it is told to, and not when it is there."""

    def __init__(self, *args: Any, file: Path, **options: Any) -> None:
        super().__init__(*args, **options)
        self._file, self._from_s = file, None

    def _now_ns(self, started_s: float, speed: float) -> int:
        if self._from_s is None and self._file.exists():
            self._from_s = float(self._file.read_text(encoding="utf-8"))
        since_s = -1.0 if self._from_s is None else time.monotonic() - self._from_s
        return self._source.first_stamp_ns + int(since_s * 1e9)


def serve(setup: StandinSetup, bus: Bus, life: ProcessLife) -> None:
    """Drive the path of `setup` until the run is over."""
    parameters = read_parameters()
    path = read_path(Path(os.environ[PATH]), driver=parameters.driver, anchor=setup.anchor)
    source = _Noted(path, parameters, vehicle_id=setup.vehicle_id, anchor=setup.anchor)
    process = _Punctual(
        _Ahead(source, round(float(os.environ[AHEAD_S]) * 1e9)),
        bus=bus,
        life=life,
        vehicle_id=setup.vehicle_id,
        speed=1.0,
        anchor=setup.anchor,
        file=Path(os.environ[FROM]),
    )
    (Path(os.environ[TRUTH]) / f"{setup.vehicle_id}{THERE}").touch()
    process.serve()
    _write_truth(setup, source)


def _write_truth(setup: StandinSetup, source: _Noted) -> None:
    """Write where it was in the World, with seconds since it set off."""
    assert setup.anchor is not None
    _, *xy, yaw_rad = np.array(source.poses).T
    xy_m = np.stack(xy, axis=1)
    lat_deg, lon_deg = geo_from_local(source.frame, xy_m).T
    yaw_east_rad = geo_from_local_yaw(source.frame, yaw_rad, xy_m)
    there = setup.anchor.world_from_lot_line(AnchorLine(lat_deg, lon_deg, yaw_east_rad))
    since_s = [(stamp_ns - START_STAMP_NS) / 1e9 for stamp_ns, *_ in source.poses]
    told = {name: column.tolist() for name, column in there._asdict().items()}
    file = Path(os.environ[TRUTH]) / f"{setup.vehicle_id}.json"
    file.write_text(json.dumps(told | {"since_s": since_s}), encoding="utf-8")


def main() -> None:
    """Be the process, or the command that starts it."""
    if sys.argv[1] != "join":
        run_process(StandinSetup, serve)
    from foretwin.orchestrator.commands import cli
    from foretwin.orchestrator.commands import join as command
    from foretwin.orchestrator.runner.launch import FreshInterpreter

    command.STANDIN = "system.encounter_car"
    command.FreshInterpreter = functools.partial(FreshInterpreter, package="tests")  # type: ignore[misc,assignment]
    sys.exit(cli.run(sys.argv[1:]))


if __name__ == "__main__":
    main()
