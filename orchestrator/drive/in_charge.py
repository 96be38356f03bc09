"""The orchestrator's word towards a real vehicle: said from the loop itself, never beside it, and
signed with a key that nobody else has."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from foretwin.contracts.bus import Bus
from foretwin.contracts.signing import COMMAND_KEY, OrderSigner
from foretwin.contracts.towards_vehicle import Authority, OrderKeys
from foretwin.orchestrator.plan import DrivePlan

EVERY_NS = 20_000_000


class SwornIn(NamedTuple):
    """A plan that tells the gateway whose orders count, and who says that somebody is in charge."""

    plan: DrivePlan
    signer: OrderSigner | None


@contextlib.contextmanager
def sworn_in(plan: DrivePlan) -> Iterator[SwornIn]:
    """Make the keys of a run from which anything may go towards the vehicle; else do nothing.

    The key of the orchestrator's own word never leaves the memory of supervisor and orchestrator;
    one that comes back after a kill says nothing with it. That of commands lies in the run's
    folder, for its owner alone, until the block is left.
    """
    if not plan.towards_vehicle:
        yield SwornIn(plan, None)
        return
    authority = OrderSigner.with_new_key(run_id=plan.run_id, channel="authority")
    command = OrderSigner.with_new_key(run_id=plan.run_id, channel="vehicle_command")
    file = plan.folder / COMMAND_KEY
    file.unlink(missing_ok=True)
    command.keep(file)
    keys = OrderKeys(authority=authority.public_key, vehicle_command=command.public_key)
    try:
        yield SwornIn(dataclasses.replace(plan, order_keys=keys), authority)
    finally:
        file.unlink(missing_ok=True)


class InCharge:
    """Says that the orchestrator is in charge; raises ValueError unless both switches are on.

    No thread says it: a loop that hangs must fall silent, so that the gateway shuts.
    """

    def __init__(
        self,
        bus: Bus,
        plan: DrivePlan,
        signer: OrderSigner | None,
        *,
        mono_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        if not plan.towards_vehicle or signer is None:
            raise ValueError("nothing may go towards the vehicle: a switch is off")
        self._bus, self._run_id, self._mono_ns = bus, plan.run_id, mono_ns
        self._signer = signer
        self._said_ns: int | None = None

    def say(self) -> None:
        """Say it, 50 times a second at most."""
        now_ns = self._mono_ns()
        if self._said_ns is None or now_ns - self._said_ns >= EVERY_NS:
            self._said_ns = now_ns
            word = self._signer.signed(Authority(sent_mono_ns=now_ns))
            self._bus.publish("authority", word, run=self._run_id)
