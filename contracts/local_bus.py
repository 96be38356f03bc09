"""The bus of one host: a socket that is this user's alone, on which everybody has a password.

Where there can be no such socket, the same passwords on the loopback interface.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.access import BusMember, access_control
from foretwin.contracts.credentials import (
    SOCKET,
    USERS,
    bus_folder,
    credentials_file,
    make_credentials,
    runtime_folder,
)
from foretwin.contracts.errors import UserError
from foretwin.contracts.keys import BusRole
from foretwin.contracts.owned_folder import OwnedFolder, own, remove_left
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import Admission, BusSetup

BUS = "bus"
"""The folder of names and passwords where there can be no socket."""
WATCH = "viewer-watch"
"""Who looks on from another seat; it needs no token, since nobody waits for it."""
CAR_OF = "car-of-"
"""Before a vehicle's id: the name, and the process, of who speaks for it and was not started by the
drive."""
OUTSIDERS = (
    BusMember("operator", "operator"),
    BusMember("planner", "planner"),
    BusMember(WATCH, "viewer", "watch"),
)
"""Who may join the bus of a drive without having been started by it."""


class LocalBus(NamedTuple):
    """How the router is set, and where the names and passwords of its clients lie."""

    router: BusSetup
    folder: Path
    trouble: str = ""
    """Why it is no socket."""
    owned: OwnedFolder | None = None

    def setup_of(self, user: str) -> BusSetup:
        """Return how somebody joins."""
        return BusSetup(
            endpoint=self.router.endpoint,
            lossless=self.router.lossless,
            credentials=str(credentials_file(self.folder, user)),
        )

    def remove(self) -> None:
        """Leave nothing."""
        shutil.rmtree(self.folder, ignore_errors=True)
        if self.owned is not None:
            self.owned.remove()


@contextlib.contextmanager
def private_files() -> Iterator[None]:
    """Let what is made within be this user's alone; the whole process is concerned meanwhile."""
    before = os.umask(0o077)
    try:
        yield
    finally:
        os.umask(before)


def member_of(role: BusRole, process_id: str, *, vehicle_id: str = "*") -> BusMember:
    """Return one of a run's processes as somebody on its bus."""
    name = process_id if process_id == role else f"{role}-{process_id}"
    return BusMember(name, role, process_id, vehicle_id)


def make_local_bus(
    name: str, members: Iterable[BusMember], *, run_id: str, lossless: bool, instead: Path
) -> LocalBus:
    """Make the folder `name` of a bus with a password for each member, this process's and its
    forks'; the folders of those that were killed go.

    Where there can be no socket, they lie below `instead`, and the bus is on the loopback.
    """
    members = tuple(members)
    trouble = ""
    try:
        remove_left(runtime_folder())
        folder = bus_folder(name)
        endpoint = f"unixsock-stream/{folder / SOCKET}"
    except UserError as error:
        trouble, endpoint = str(error), free_endpoint()
        folder = instead / BUS
        folder.mkdir(mode=0o700, parents=True)
    make_credentials(folder, [one.name for one in members])
    access = access_control(members, subject="usernames", run_id=run_id)
    admits = Admission(users_file=str(folder / USERS), access=json.dumps(access))
    router = BusSetup(endpoint=endpoint, lossless=lossless, admits=admits)
    return LocalBus(router, folder, trouble, own(folder))
