"""Somebody on the bus of a drive who does not belong there, and says what he likes."""

from __future__ import annotations

import random
import time

import msgspec
import zenoh

from foretwin.contracts.bus import zenoh_config
from foretwin.contracts.codec import encode
from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.contracts.keys import CHANNELS, alive_key, key
from foretwin.contracts.setup import BusSetup
from tests.contracts.hostile_messages import hostile_bytes

MESSAGES = 150
_UNSAID = ("end", "run_end", "authority")
"""Well formed, these end a drive or let commands out, as long as the bus asks nobody who speaks."""
_BURST_HZ = {"imu": 1000.0, "speed": 500.0}
"""Ten times what a car sends."""


def say_anything(endpoint: str, run_id: str, strength: float) -> str:
    """Say damaged and foreign messages on all channels; returns what became of it, in words."""
    chance = random.Random(strength)
    channels = [name for name in CHANNELS if name not in _UNSAID]
    try:
        with zenoh.open(zenoh_config(BusSetup(endpoint=endpoint), router=False)) as session:
            token = session.liveliness().declare_token(alive_key(run=run_id, process="x9") + "{}")
            session.put("**", b"on everything")
            for _ in range(MESSAGES):
                channel = chance.choice(channels)
                full = key(channel, vehicle="ego", run=run_id, process="w0")
                data = hostile_bytes(CHANNELS[channel].kind, chance)
                if CHANNELS[channel].reply is None:
                    session.put(full, data)
                else:
                    session.get(full, payload=data, timeout=1.0)
            token.undeclare()
    except zenoh.ZError as refused:
        return f"not let in: {str(refused)[:80]}"
    return f"{MESSAGES} messages"


def burst(endpoint: str, run_id: str, for_s: float) -> str:
    """Send well-formed samples under the car's name, ten times as many as a car."""
    begun_s, sent = time.monotonic(), dict.fromkeys(_BURST_HZ, 0)
    try:
        with zenoh.open(zenoh_config(BusSetup(endpoint=endpoint), router=False)) as session:
            while (passed_s := time.monotonic() - begun_s) < for_s:
                for channel, rate_hz in _BURST_HZ.items():
                    full = key(channel, vehicle="ego", run=run_id, process="w0")
                    while sent[channel] < passed_s * rate_hz:
                        session.put(full, _sample(channel, sent[channel]))
                        sent[channel] += 1
                time.sleep(0.01)
    except zenoh.ZError as refused:
        return f"not let in: {str(refused)[:80]}"
    return f"{sum(sent.values())} samples"


def _sample(channel: str, seq: int) -> bytes:
    stamp_ns, zero = 1_767_225_600_000_000_000 + seq, (0.0, 0.0, 0.0)
    message: msgspec.Struct = SpeedSample(stamp_ns=stamp_ns, speed_mps=3.0)
    if channel == "imu":
        message = ImuSample(stamp_ns=stamp_ns, accel_mps2=zero, rate_radps=zero)
    return encode(message, seq=seq, sent_ns=time.time_ns(), sender=99)
