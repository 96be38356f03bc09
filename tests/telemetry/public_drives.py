"""Public recordings beside the given ones, read where FORETWIN_DRIVES names their folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def public_drive(name: str) -> Path:
    """Return a recording below the folder of public drives, or skip the test that asks for it."""
    folder = os.environ.get("FORETWIN_DRIVES")
    if not folder:
        pytest.skip("FORETWIN_DRIVES is not set: no public recordings here")
    path = Path(folder) / name
    if not path.exists():
        pytest.skip(f"FORETWIN_DRIVES has no {name}")
    return path
