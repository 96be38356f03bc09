"""What is installed is pinned with hashes, and nothing below a known hole may be."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[1]
KNOWN_HOLES = {"lxml": "6.0.4", "pyarrow": "23.0.0"}
"""The newest version of a package with a hole that concerns us."""


APART = {"ray", "sumo"}
"""Extras that `make setup` does not install: 264 and 510 MB, which their own judges alone need."""


def requirements() -> list[Requirement]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert extras.keys() >= APART
    wanted = [text for name in extras.keys() - APART for text in extras[name]]
    return [Requirement(text) for text in (*project["dependencies"], *sorted(wanted))]


def pins() -> dict[str, str]:
    """Return the pinned versions; each line begins a package, its hashes are indented."""
    text = (ROOT / "constraints.txt").read_text()
    blocks = re.findall(
        r"^([A-Za-z0-9._-]+)==(\S+) \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, re.M
    )
    lines = sum(1 + block.count("\n") for *_, block in blocks) + 1
    assert lines == text.count("\n"), "something beside pins, their hashes and the first line"
    return {canonicalize_name(name): pinned for name, pinned, _ in blocks}


@pytest.mark.parametrize("wanted", requirements(), ids=lambda one: one.name)
def test_what_is_wanted_is_pinned_and_here(wanted: Requirement) -> None:
    name = canonicalize_name(wanted.name)
    assert name in pins(), "`make lock` pins what is new"
    assert pins()[name] in wanted.specifier


@pytest.mark.parametrize("name", KNOWN_HOLES)
def test_what_has_a_known_hole_is_refused(name: str) -> None:
    (wanted,) = (one for one in requirements() if one.name == name)
    assert KNOWN_HOLES[name] not in wanted.specifier
    assert Version(pins()[name]) > Version(KNOWN_HOLES[name])


def test_the_lock_names_no_registry() -> None:
    text = (ROOT / "constraints.txt").read_text()
    assert not re.search(r"://|--(index|extra-index|find-links|trusted)", text)
