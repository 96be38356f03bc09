"""Somebody on the bus of a drive who does not belong there, and says what he likes.

Where all may speak he needs nothing. On a socket or over TLS he shows nothing, something wrong, or
what he stole of one of the drive's own processes, and is let do what that one may.
"""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import zenoh

from foretwin.contracts.campaign import role_files
from foretwin.contracts.codec import encode
from foretwin.contracts.credentials import credentials_file, make_credentials
from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.contracts.joining import RunningDrive
from foretwin.contracts.keys import CHANNELS, alive_key, key
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.zenoh_config import zenoh_config
from tests.contracts.hostile_messages import hostile_bytes

MESSAGES = 150
_ENDS = ("end", "run_end", "authority")
"""Well formed, these end a drive or let commands out where nobody is asked who speaks; the first of
them where the car is believed."""
_BURST_HZ = {"imu": 1000.0, "speed": 500.0}
"""Ten times what a car sends."""
_ROLES = ("worker", "viewer", "recorder", "car", "planner", "operator")


class Guise(NamedTuple):
    """As whom a stranger comes, and by what."""

    name: str
    setup: BusSetup

    @property
    def unsaid(self) -> Sequence[str]:
        """Channels on which even a bus that works would have to believe him."""
        if self.name == "anybody":
            return _ENDS
        return _ENDS[:1] if self.name.startswith("car") else ()


def guise(
    drive: RunningDrive,
    campaign: Path | None,
    scratch: Path,
    chance: random.Random,
    *,
    rather: str = "",
) -> Guise:
    """Draw as whom a stranger comes; what he makes himself lies in `scratch`.

    Where he comes as a member, in two of three cases as one of the role `rather`, if there is one.
    """
    plain = BusSetup(endpoint=drive.endpoint)
    if campaign is not None:
        if chance.random() < 0.2:
            return Guise("without a certificate", plain)
        role = rather if rather and chance.random() < 0.67 else chance.choice(_ROLES)
        return Guise(role, BusSetup(endpoint=drive.endpoint, tls=role_files(campaign, role)))  # type: ignore[arg-type]
    if drive.credentials is None:
        return Guise("anybody", plain)
    stolen = sorted(
        file for file in drive.credentials.glob("*.json") if file.stem != "orchestrator"
    )
    if chance.random() < 0.2 or not stolen:
        return Guise("without a password", plain)
    if chance.random() < 0.2:
        return Guise("with another run's password", _wrong(drive.endpoint, scratch))
    wanted = [file for file in stolen if rather and file.stem.startswith(rather)]
    file = chance.choice(wanted if wanted and chance.random() < 0.67 else stolen)
    return Guise(file.stem, drive.bus(file.stem))


def _wrong(endpoint: str, scratch: Path) -> BusSetup:
    """Return a setup of a member of the run, with a password of another one."""
    folder = scratch / "another-run"
    if not folder.exists():
        folder.mkdir()
        make_credentials(folder, ["operator"])
    return BusSetup(endpoint=endpoint, credentials=str(credentials_file(folder, "operator")))


def say_anything(who: Guise, run_id: str, chance: random.Random) -> str:
    """Say damaged and foreign messages on all channels; returns what became of it, in words."""
    channels = [name for name in CHANNELS if name not in who.unsaid]
    try:
        with zenoh.open(_config(who.setup)) as session:
            token = session.liveliness().declare_token(alive_key(run=run_id, process="x9") + "{}")
            session.put("**", b"on everything")
            for number in range(MESSAGES):
                channel = channels[number % len(channels)]
                full = key(channel, vehicle="ego", run=run_id, process="w0")
                data = hostile_bytes(CHANNELS[channel].kind, chance)
                if CHANNELS[channel].reply is None:
                    session.put(full, data)
                else:
                    session.get(full, payload=data, timeout=1.0)
            token.undeclare()
    except zenoh.ZError as refused:
        return f"{who.name}, not let in: {str(refused)[:80]}"
    return f"{who.name}, {MESSAGES} messages"


def burst(who: Guise, run_id: str, for_s: float) -> str:
    """Send well-formed samples under the car's name, ten times as many as a car."""
    begun_s, sent = time.monotonic(), dict.fromkeys(_BURST_HZ, 0)
    try:
        with zenoh.open(_config(who.setup)) as session:
            while (passed_s := time.monotonic() - begun_s) < for_s:
                for channel, rate_hz in _BURST_HZ.items():
                    full = key(channel, vehicle="ego", run=run_id, process="w0")
                    while sent[channel] < passed_s * rate_hz:
                        session.put(full, _sample(channel, sent[channel]))
                        sent[channel] += 1
                time.sleep(0.01)
    except zenoh.ZError as refused:
        return f"{who.name}, not let in: {str(refused)[:80]}"
    return f"{who.name}, {sum(sent.values())} samples"


def _config(setup: BusSetup) -> zenoh.Config:
    config: zenoh.Config = zenoh_config(setup, router=False)
    config.insert_json5("connect/timeout_ms", "3000")
    return config


def _sample(channel: str, seq: int) -> bytes:
    stamp_ns, zero = 1_767_225_600_000_000_000 + seq, (0.0, 0.0, 0.0)
    message: msgspec.Struct = SpeedSample(stamp_ns=stamp_ns, speed_mps=3.0)
    if channel == "imu":
        message = ImuSample(stamp_ns=stamp_ns, accel_mps2=zero, rate_radps=zero)
    return encode(message, seq=seq, sent_ns=time.time_ns(), sender=99)
