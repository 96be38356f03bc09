"""The address of the display: the same for one process of one run, and for nobody else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.credentials import credentials_file, make_credentials
from foretwin.contracts.page_address import USUAL_PORT, page_address, page_key
from foretwin.contracts.ports import LOOPBACK
from foretwin.contracts.process_setup import BusSetup
from tests.pages import page


def joins(folder: Path, user: str) -> BusSetup:
    return BusSetup(endpoint="x", credentials=str(credentials_file(folder, user)))


def test_a_key_is_that_of_one_process_of_one_run(tmp_path: Path) -> None:
    make_credentials(tmp_path, ["viewer-copilot", "viewer-watch"])
    setup = joins(tmp_path, "viewer-copilot")
    key = page_key(setup, "run1")
    assert re.fullmatch("[0-9a-f]{16}", key)
    assert page_key(setup, "run1") == key, "started again, it is found where it was"
    others = {page_key(setup, "run2"), page_key(joins(tmp_path, "viewer-watch"), "run1")}
    assert key not in others
    assert len(others) == 2


def test_over_a_network_it_follows_from_the_certificates_key(tmp_path: Path) -> None:
    file = tmp_path / "key.pem"
    setup = BusSetup(endpoint="tls/x:1", tls=TlsFiles(authority="", certificate="", key=str(file)))
    file.write_bytes(b"one")
    first = page_key(setup, "run1")
    file.write_bytes(b"another")
    assert page_key(setup, "run1") != first
    assert page_key(BusSetup(endpoint="tcp/x:1"), "run1") != first


def test_the_page_tells_where_it_is_usually_opened() -> None:
    assert page_address("1d9c09c621f3f08a", port=USUAL_PORT) in page("copilot.md")


@pytest.mark.parametrize(
    ("host", "secure", "said"),
    [(LOOPBACK, False, "http://127.0.0.1:80/k/"), ("::1", True, "https://[::1]:80/k/")],
)
def test_an_address_can_be_opened(host: str, secure: bool, said: str) -> None:
    assert page_address("k", host=host, port=80, secure=secure) == said
