"""A stranger on the bus of a live drive: whatever it says, the drive goes on and says what it
refused."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path

import numpy as np
import pytest
import zenoh

from foretwin.contracts.bus import zenoh_config
from foretwin.contracts.codec import encode
from foretwin.contracts.drive import GnssFix, PlannedTrajectory, RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.keys import CHANNELS, alive_key, key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from tests.contracts.hostile_messages import hostile_bytes
from tests.system.foretwin_command import Finished, log_lines, run_folder, started, wait_for

LIVE = ("--end", "12", "--futures", "8", "--rate", "1")
STAMP_NS = 1_000_000_000


def odd_plan() -> PlannedTrajectory:
    one = np.ones(4)
    return PlannedTrajectory(
        stamp_ns=STAMP_NS, time_from_stamp_s=one, lat_deg=one, lon_deg=one, yaw_rad=one[:3],
        speed_mps=one,
    )  # fmt: skip


def ghost() -> RoadUsers:
    user = RoadUser(
        user_id="[/a]", kind="car", position=GeoPoint(float("nan"), 0.0), yaw_rad=0.0,
        speed_mps=float("inf"), length_m=0.0, width_m=0.0,
    )  # fmt: skip
    return RoadUsers(stamp_ns=STAMP_NS, users=(user,))


def speak(endpoint: str, run: str) -> None:
    """Say everything that once ended a drive, and a thousand things made by chance."""
    chance = random.Random(0)
    channels = [name for name in CHANNELS if name not in ("end", "run_end", "authority")]

    def full_key(channel: str) -> str:
        return key(channel, vehicle="ego", run=run, process="w0")

    config = zenoh_config(BusSetup(endpoint=endpoint), router=False)
    with zenoh.open(config) as session:
        token = session.liveliness().declare_token(alive_key(run=run, process="x9") + "{}")
        session.put("**", b"on everything")
        session.put(full_key("mirror"), b"hello")
        session.put(full_key("run_end"), b"hello")
        session.put(full_key("plan"), encode(odd_plan(), seq=0))
        for _ in range(3):
            session.put(full_key("objects"), encode(ghost(), seq=0, sent_ns=time.time_ns()))
            fix = GnssFix(stamp_ns=STAMP_NS, position=GeoPoint(0.0, float("nan")))
            session.put(full_key("gnss"), encode(fix, seq=0, sent_ns=time.time_ns()))
        answers = list(session.get("foretwin/v1/**", payload=b"hello", timeout=5.0))
        assert len([one for one in answers if one.err is not None]) > 3
        for _ in range(1000):
            channel = chance.choice(channels)
            data = hostile_bytes(CHANNELS[channel].kind, chance)
            data = data[:8] + bytes(8) + data[16:]  # each is its sender's first
            if CHANNELS[channel].reply is None:
                session.put(full_key(channel), data)
        token.undeclare()


def test_a_drive_survives_a_stranger_and_counts_what_it_said(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    open_to_all = ("--endpoint", free_endpoint(), "--insecure")
    with started(out, *LIVE, *open_to_all) as process:

        def begun() -> bool:
            folder = run_folder(out)
            return folder is not None and any(
                line["text"].startswith("world ") for line in log_lines(folder)
            )

        wait_for(begun, "the first World")
        folder = run_folder(out)
        assert folder is not None
        running = json.loads((folder / "run.json").read_text())
        speak(running["endpoint"], running["run_id"])
        screen, _ = process.communicate(timeout=240.0)
    done = Finished(process.returncode, screen, run_folder(out))

    # On the car's keys its samples cannot be told from the car's: what was refused of them is said
    # to be missing from the recording, last and by the exit code.
    assert done.code == 3, screen
    record = done.record()
    assert record["ledger"]["telemetry"]["lost_by"]["refused"] > 0
    assert screen.splitlines()[-1].startswith("lost: ")
    assert record["exit"] == "completed"
    kinds = record["refused"]["by_sender"]
    refused = {(one["sender"], one["reason"]): one["count"] for one in kinds}
    own = f"run/{record['run_id']}"
    assert refused[f"{own}/mirror", "no message"] >= 1
    assert refused["vehicle/ego/telemetry/plan", "PlannedTrajectory: yaw_rad of another shape"] >= 1
    assert refused["vehicle/ego/telemetry/objects", "road users that cannot be"] >= 3
    assert refused["vehicle/ego/telemetry/gnss", "GnssFix: lon_deg not finite"] >= 3
    assert any("sent to many keys at once" in reason for _, reason in refused)
    assert "refused" in screen
    # Whatever the stranger's numbering was, none of the car's own samples is missing.
    assert record["telemetry"]["lost"] < 100
    assert record["workers"]["restarted"] == 0
    assert done.rows("rounds")
    lines = log_lines(done.run) if done.run else []
    assert not [line for line in lines if "traceback" in line]


BROKEN_AT_THE_END = """
import sys
from pathlib import Path
from foretwin.contracts.mailbox import Mailbox

take_last = Mailbox.take_last

def broken(mailbox, quiet_s):
    if Path("/proc/self/comm").read_text().strip() == "ft-orchestrator":
        raise RuntimeError("an error of ours")
    return take_last(mailbox, quiet_s)  # the others are forks, too

Mailbox.take_last = broken
from foretwin.__main__ import main

sys.exit(main())
"""


@pytest.mark.judge
def test_an_error_of_ours_in_the_last_mail_costs_no_table(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    small = ("--speed", "max", "--futures", "6", "--rate", "0.5", "--end", "6")
    with started(out, *small, entry=("-c", BROKEN_AT_THE_END)) as process:
        screen, _ = process.communicate(timeout=240.0)
    done = Finished(process.returncode, screen, run_folder(out))

    assert done.code == 1, screen
    assert done.record()["exit"] == "failed"
    assert done.rows("rounds")
    assert done.run is not None
    (told,) = (line for line in log_lines(done.run) if "traceback" in line)
    assert "an error of ours" in told["traceback"]
