from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.ports import LOOPBACK, free_port
from foretwin.orchestrator.drive import metrics_server
from foretwin.orchestrator.drive.metrics_server import TYPE, listening, told_metrics
from foretwin.orchestrator.drive.operator_metrics import MetricSample
from tests.contracts.bus_sides import DEADLINE_S


@contextmanager
def telling(folder: Path, *, turns: bool = True, asked: int = 1) -> Iterator[str]:
    """Tell metrics beside a loop that has turns, or hangs; gives the address.

    So often is the page asked for, and answered.
    """
    read_in: list[str] = []

    def read(now_s: float) -> list[MetricSample]:
        read_in.append(threading.current_thread().name)
        return [MetricSample("drive_seconds", now_s)]

    over = threading.Event()

    def loop() -> None:
        while not over.wait(0.01):
            if turns:
                look(7.0)

    port = free_port()
    with listening(str(port)) as listener, told_metrics(listener, read, processes=folder) as look:
        thread = threading.Thread(target=loop, name="the loop")
        thread.start()
        try:
            yield f"http://{LOOPBACK}:{port}"
        finally:
            over.set()
            thread.join()
    # Nobody reads beside the loop what it changes, nor more often than somebody asks.
    assert read_in == asked * ["the loop"]


def test_who_asks_is_told_what_the_loop_reads(tmp_path: Path) -> None:
    with telling(tmp_path, asked=2) as address:
        httpx.get(f"{address}/metrics")
        page = httpx.get(f"{address}/metrics")

    assert (page.status_code, page.headers["content-type"]) == (200, TYPE)
    said = page.text.splitlines()
    assert "foretwin_drive_seconds 7" in said
    assert said[-1] == 'foretwin_refused_total{by="processes"} 0', "what lies in files"


def test_a_loop_that_hangs_tells_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metrics_server, "ANSWER_S", 0.1)
    with telling(tmp_path, turns=False, asked=0) as address:
        assert httpx.get(f"{address}/metrics").status_code == 503


def test_only_metrics_are_told_and_only_to_be_read(tmp_path: Path) -> None:
    with telling(tmp_path, asked=0) as address:
        assert httpx.get(f"{address}/").status_code == 404
        assert httpx.post(f"{address}/metrics", content=b"x").status_code == 501


def test_who_says_nothing_keeps_nobody_out_for_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics_server, "CLIENT_S", 0.1)
    with telling(tmp_path) as address:
        port = int(address.rsplit(":", 1)[1])
        with socket.create_connection((LOOPBACK, port)):
            assert httpx.get(f"{address}/metrics", timeout=30.0).status_code == 200


def test_who_spells_his_question_out_holds_up_neither_others_nor_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(metrics_server, "CLIENT_S", 0.2)
    over, port = threading.Event(), free_port()
    with listening(str(port)) as listener, told_metrics(listener, lambda _: [], processes=tmp_path):
        slow = socket.create_connection((LOOPBACK, port), timeout=DEADLINE_S)
        slow.sendall(b"GET /")

        def spell() -> None:
            with contextlib.suppress(OSError):
                while not over.wait(0.02):
                    slow.sendall(b"m")

        speller = threading.Thread(target=spell)
        speller.start()
        try:
            assert slow.recv(1) == b"", "he was let go"
        finally:
            over.set()
            speller.join()
            slow.close()
    assert capfd.readouterr().err == ""


def test_who_hangs_up_leaves_nothing_on_the_screen(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with telling(tmp_path) as address:
        port = int(address.rsplit(":", 1)[1])
        gone = socket.create_connection((LOOPBACK, port))
        gone.sendall(b"GET /met")
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # by a reset
        gone.close()
        assert httpx.get(f"{address}/metrics").status_code == 200
    assert capfd.readouterr().err == ""


def test_a_place_that_is_taken_is_told_before_anything_is_done() -> None:
    with socket.socket() as other:
        other.bind((LOOPBACK, 0))
        other.listen()
        place = f"{LOOPBACK}:{other.getsockname()[1]}"
        told = pytest.raises(UserError, match=f"--metrics {place}: nothing can listen there")
        with told, listening(place):
            pass


def test_nobody_listens_unless_asked(tmp_path: Path) -> None:
    with (
        listening(None) as listener,
        told_metrics(listener, lambda _: [], processes=tmp_path) as look,
    ):
        look(1.0)
    assert listener is None
