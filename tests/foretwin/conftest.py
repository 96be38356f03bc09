"""The drawn town as the face has it, and the World of its first crossing."""

from __future__ import annotations

import pytest

import foretwin


@pytest.fixture(scope="module")
def town() -> foretwin.Map:
    return foretwin.drawn_town()


@pytest.fixture(scope="module")
def world(town: foretwin.Map) -> foretwin.World:
    return town.world(next(one.id for one in town.intersections if one.kind == "crossing"))
