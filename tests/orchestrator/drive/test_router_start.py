"""Why a run's router cannot listen, in the words of who has to mend it."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.drive.router_start import cannot_listen_text

IN_USE = "Can not create a new TCP listener bound to tcp/127.0.0.1:7447: Address already in use"


@pytest.mark.parametrize(
    ("endpoint", "word", "says"),
    [
        ("tcp/127.0.0.1:7447", IN_USE, "port 7447 is taken"),
        ("tcp/[::1]:7447?rel=1", IN_USE, "port 7447 is taken"),
        ("tcp/10.9.8.7:7447", "Cannot assign requested address", "cannot be listened on here"),
        ("tcp/127.0.0.1:7447", "", "cannot be listened on here"),
    ],
)
def test_what_is_taken_is_told_from_what_is_not_here(endpoint: str, word: str, says: str) -> None:
    text = cannot_listen_text(endpoint, word)
    assert says in text
    assert text.startswith(f"endpoint {endpoint}: ")
