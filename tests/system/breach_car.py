"""A car on a lot that does wrong, and says again whom it was shown: the process of one breach.

`python -m tests.system.breach_car MAPPING BREACH.json PID` drives until its stack first hears of
somebody, some seconds more, does wrong, and prints in the end when that was and what its stack has
heard, as JSON (`Drove`). PID is whose process is halted, where that is what goes wrong.

Its perception sees a real pedestrian too, and whatever is virtual, as if it were there.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.foreign_bus import ForeignBus, ZenohForeignBus
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.setup import BusSetup
from foretwin.telemetry.lot_car.lot_car import LotCar
from foretwin.telemetry.ros2.mapping import Mapping, parse_mapping
from foretwin.telemetry.ros2.rows import OutRow
from foretwin.telemetry.ros2.sender import RosSender
from foretwin.telemetry.ros_messages.objects import predicted_from_users
from foretwin.telemetry.ros_messages.parts import PREDICTED_OBJECTS, typestore
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import StandinSource
from tests.system.breaches import HALTED, KINDS, WAY_M, Breach, Spoiler, lot_place

SEEN = "/perception/seen"
REAL_M = 30.0, -40.0
"""Where somebody stands on the lot, well beside the way."""
FIRST_WITHIN_S, WRONG_WITHIN_S, AFTER_S = 30.0, 25.0, 2.5
_SEES_EVERY_NS = 100_000_000


class Heard(msgspec.Struct, frozen=True):
    """A list as the driving stack receives it: when, by UTC, and where who stands in it."""

    wall_ns: int
    at_m: list[tuple[float, float]]
    """Each in metres east and north of the lot's `[map]`."""


class Drove(msgspec.Struct, frozen=True, kw_only=True):
    """What came of one breach: when the car was in the wrong, and when a halted process went on."""

    wrong_ns: int | None
    goes_on_ns: int | None
    heard: list[Heard]
    echoes: int
    """So often its perception has said again whom it was shown."""


class _WrongSource(StandinSource):
    """The stand-in, which says what a breach makes of its samples from a stamp on."""

    def __init__(self, *args: Any, spoiler: Spoiler, **options: Any) -> None:
        super().__init__(*args, **options)
        self._spoiler, self._late = spoiler, list[tuple[str, Any]]()
        self.spoils_from_ns: int | None = None

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, Any]]:
        for channel, message in super().advance(until_stamp_ns):
            if self.spoils_from_ns is None or message.stamp_ns < self.spoils_from_ns:
                yield channel, message
            elif self._spoiler.late_ns:
                self._late.append((channel, message))
            elif (spoilt := self._spoiler.spoilt(channel, message)) is not None:
                yield channel, spoilt
        while self._late and self._late[0][1].stamp_ns + self._spoiler.late_ns <= until_stamp_ns:
            yield self._late.pop(0)


class BreachCar(LotCar):
    """The car, its stack's ear and its perception."""

    def __init__(self, mapping: Mapping, breach: Breach, foreign: ForeignBus) -> None:
        parameters = read_parameters()
        ends = [lot_place(s_m, 0.0) for s_m in (0.0, WAY_M)]
        path = DrivenPath(
            np.array([one.lat_deg for one in ends]), np.array([one.lon_deg for one in ends]),
            np.full(2, breach.speed_mps), driver=parameters.driver,
        )  # fmt: skip
        self.spoiler = Spoiler(breach)
        source = _WrongSource(path, parameters, vehicle_id="ego", spoiler=self.spoiler)
        ratio = parameters.car.steering_ratio
        super().__init__(mapping, source, foreign=foreign, steering_ratio=ratio)
        assert mapping.map_frame is not None
        self._stands, self._frame = source, mapping.map_frame
        self._perception = RosSender(mapping, foreign, wall_ns=time.time_ns)
        self._saw_ns = 0
        self._shown: tuple[RoadUser, ...] = ()
        self.heard: list[Heard] = []
        self.wrong_ns: int | None = None
        self.echoes = 0

    def go_on(self, until: Callable[[], bool], *, within_s: float) -> bool:
        """Drive until a condition holds; returns whether it did in time."""
        deadline_s = time.monotonic() + within_s
        while not until():
            if time.monotonic() > deadline_s:
                return False
            self.step()
            self._look()
            begun = self._stands.spoils_from_ns is not None
            if self.wrong_ns is None and self.spoiler.is_wrong(
                self._stands.s_m, self._stands.speed_mps, begun=begun
            ):
                self.wrong_ns = time.time_ns()
        return True

    def begin(self) -> None:
        """Spoil what is said from now on."""
        self._stands.spoils_from_ns = self._stamp_ns(time.monotonic_ns())
        self.spoiler.begin(self._stands.s_m)

    def _hear(self, message: Any, received_ns: int) -> None:
        super()._hear(message, received_ns)
        self._shown = message.users
        places = [(one.position.lat_deg, one.position.lon_deg) for one in message.users]
        at_m = [tuple(local_from_geo(self._frame, *one).tolist()) for one in places]
        self.heard.append(Heard(received_ns, at_m))

    def _look(self) -> None:
        """Say whom the car sees: who is there, and who is not."""
        if (now_ns := time.time_ns()) - self._saw_ns < _SEES_EVERY_NS:
            return
        self._saw_ns = now_ns
        real = RoadUser(
            user_id="0123456789abcdef0123456789abcdef", kind="pedestrian", speed_mps=0.0,
            position=lot_place(*REAL_M), yaw_rad=0.0, length_m=0.4, width_m=0.7, virtual=False,
        )  # fmt: skip
        self.echoes += len(self._shown)
        sees = RoadUsers(stamp_ns=now_ns, users=(real, *self._shown))
        ros = predicted_from_users(sees, self._frame)
        row = OutRow(topic=SEEN, type=PREDICTED_OBJECTS, source="virtual_objects")
        self._perception.put(row, bytes(typestore().serialize_cdr(ros, PREDICTED_OBJECTS)))


def drove(mapping: Mapping, breach: Breach, pid: int) -> Drove:
    """Play one breach."""
    assert mapping.endpoint is not None
    goes_on_ns = None
    with ZenohForeignBus(BusSetup(endpoint=mapping.endpoint)) as foreign:
        car = BreachCar(mapping, breach, foreign)
        if not car.go_on(lambda: bool(car.heard), within_s=FIRST_WITHIN_S):
            return Drove(wrong_ns=None, goes_on_ns=None, heard=[], echoes=0)
        if KINDS[breach.kind].fence is None:
            car.go_on(lambda: False, within_s=breach.after_s)
            if breach.kind in HALTED:
                os.kill(pid, signal.SIGSTOP if breach.amount else signal.SIGKILL)
            car.begin()
        car.go_on(lambda: car.wrong_ns is not None, within_s=WRONG_WITHIN_S)
        if breach.kind in HALTED and breach.amount:
            car.go_on(lambda: False, within_s=breach.amount)
            os.kill(pid, signal.SIGCONT)
            goes_on_ns = time.time_ns()
        car.go_on(lambda: False, within_s=AFTER_S)
        return Drove(
            wrong_ns=car.wrong_ns, goes_on_ns=goes_on_ns, heard=car.heard, echoes=car.echoes
        )


def main(mapping: str, breach: str, pid: str) -> None:
    """Be the process."""
    read = parse_mapping(Path(mapping).read_text(encoding="utf-8"), name=mapping)
    case = msgspec.json.decode(Path(breach).read_bytes(), type=Breach)
    print(msgspec.json.encode(drove(read, case, int(pid))).decode())


if __name__ == "__main__":
    main(*sys.argv[1:])
