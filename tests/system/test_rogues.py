"""Rogues on the bus of a drive: with no, a wrong and another's password. It is untouched."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.bus import BusUnreachable, Mailbox, Reply, ZenohBus
from foretwin.contracts.credentials import Credentials
from foretwin.contracts.drive import DriveEnd, SpeedSample
from foretwin.contracts.joining import RunningDrive, running_drive
from foretwin.contracts.keys import alive_key
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.simulation import RunEnd
from foretwin.contracts.towards_vehicle import Authority
from foretwin.contracts.tuning import SetRequest
from tests.system.foretwin_command import started
from tests.system.test_faults import ENDS_WITHIN_S, LIVE, assert_nothing_left, under_way

RUN_ENDS_NS = 2**62


def speaks_out_of_turn(drive: RunningDrive, user: str) -> None:
    """Say with a password of one's own what only others may say."""
    with ZenohBus(drive.bus(user)) as rogue:
        for _ in range(20):
            sample = SpeedSample(stamp_ns=RUN_ENDS_NS, speed_mps=99.0)
            rogue.publish("speed", sample, vehicle="ego")
            rogue.publish("end", DriveEnd(stamp_ns=RUN_ENDS_NS, published={}), vehicle="ego")
            rogue.publish("authority", Authority(sent_mono_ns=1), run=drive.run_id)
            rogue.publish("run_end", RunEnd(stamp_ns=1), run=drive.run_id)
        for process in ("w0", "w9", "mirror", "orchestrator"):
            rogue.declare_alive(alive_key(run=drive.run_id, process=process))
        if user != "operator":
            replies = Mailbox(1)
            request = SetRequest(key="role.ego", value="ghost")
            rogue.request("set", request, replies, timeout_s=10.0, run=drive.run_id)
            reply = replies.take(20.0)
            assert isinstance(reply, Reply)
            assert reply.error == "no answer"


def test_rogues_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "12") as process:
        run = under_way(out)
        drive = running_drive(run)
        stolen = tmp_path / "stolen.json"
        stolen.touch(0o600)
        wrong = Credentials(user="car-vehicle", password="guessed")
        stolen.write_bytes(msgspec.json.encode(wrong))
        for shown in (None, str(stolen)):
            with pytest.raises(BusUnreachable):
                ZenohBus(BusSetup(endpoint=drive.endpoint, credentials=shown))
        for user in ("worker-w1", "viewer", "planner", "operator"):
            speaks_out_of_turn(drive, user)
        assert drive.credentials is not None
        passwords = [
            msgspec.json.decode(file.read_bytes(), type=Credentials).password
            for file in drive.credentials.glob("*.json")
        ]
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    record = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert record["exit"] == "completed"
    assert record["workers"]["strangers"] == 0
    assert record["workers"]["restarted"] == 0
    assert record["refused"]["count"] == 0, "nothing of it came as far as the guard"
    telemetry = record["ledger"]["telemetry"]
    assert telemetry["published"] == telemetry["recorded"] > 0
    assert len(passwords) > 8
    texts = [file.read_bytes() for file in run.rglob("*") if file.is_file()]
    assert not any(password.encode() in text for password in passwords for text in texts)
    assert not drive.credentials.exists()
    assert_nothing_left(run)
