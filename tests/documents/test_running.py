"""Every command block of the README and of the pages, from a wheel in an empty folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.documents.blocks import Block, pages, read_page
from tests.documents.running import play_page
from tests.documents.stage import Installed

RUN = {"sh", "console", "python", "sql"}


def is_played(block: Block) -> bool:
    return block.language in RUN and "not run" not in block.marks


WITH_BLOCKS = [name for name in pages() if any(map(is_played, read_page(name).blocks))]

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1800)]


@pytest.mark.parametrize("name", WITH_BLOCKS)
def test_a_page_does_what_it_says(name: str, tmp_path: Path, installed: Installed) -> None:
    assert play_page(name, tmp_path, installed) > 0
