"""A World is called by its content: whoever has the bytes can tell whether they are it."""

from __future__ import annotations

import contextlib

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.codec import SchemaMismatch, encode
from foretwin.contracts.world_identity import checked_world, with_id
from tests.sim_worker.places import crossroads

WORLD = with_id(crossroads())
DATA = encode(WORLD)


def test_the_same_content_has_the_same_id_whatever_it_was_called_before() -> None:
    assert with_id(crossroads()).id == with_id(msgspec.structs.replace(WORLD, id="other")).id
    assert with_id(msgspec.structs.replace(WORLD, radius_m=151.0)).id != WORLD.id


def test_the_bytes_of_a_world_are_it() -> None:
    assert encode(checked_world(DATA, WORLD.id, where="bus")) == DATA


def test_another_world_is_refused_by_both_names() -> None:
    other = with_id(msgspec.structs.replace(WORLD, radius_m=151.0))
    with pytest.raises(
        SchemaMismatch, match=f"^bus: holds World {other.id} instead of {WORLD.id}$"
    ):
        checked_world(encode(other), WORLD.id, where="bus")


@given(st.integers(0, len(DATA) - 1), st.integers(1, 255))
def test_a_damaged_byte_changes_no_world(at: int, change: int) -> None:
    """It is noticed, or it lies where nothing of the World does: in the header, or in the name of
    a field that holds what it holds where it is not told."""
    damaged = bytearray(DATA)
    damaged[at] ^= change
    with contextlib.suppress(SchemaMismatch):
        assert encode(checked_world(bytes(damaged), WORLD.id, where="bus")) == DATA
