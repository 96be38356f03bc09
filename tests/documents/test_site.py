"""The site is built without a warning, whole, and asks nobody for anything when it is read."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documents.blocks import ROOT

FETCHES = re.compile(
    r"""<(?:script|img|iframe|source|audio|video)\b[^>]*\bsrc=["'](?:https?:)?//|"""
    r"""<link\b(?=[^>]*rel=["'](?:stylesheet|preload|icon|preconnect))[^>]*href=["'](?:https?:)?//|"""
    r"""@import\s+(?:url\()?["']?(?:https?:)?//|url\(["']?(?:https?:)?//"""
)
"""What a browser asks another server for; links that a reader follows are none of it."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-q",
            "-W",
            "--keep-going",
            "-d",
            folder / "trees",
            ROOT / "docs",
            folder / "html",
        ],
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    return folder / "html"


@pytest.mark.judge
def test_every_page_is_in_it_and_found_from_the_first(site: Path) -> None:
    first = (site / "index.html").read_text(encoding="utf-8")
    pages = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}

    missing = [page for page in pages if not (site / page.with_suffix(".html")).is_file()]
    assert missing == []
    unreached = [page for page in pages if f'href="{page.with_suffix(".html")}' not in first]
    assert [str(page) for page in unreached if page.name != "index.md"] == []


@pytest.mark.judge
def test_nothing_is_fetched_when_it_is_read(site: Path) -> None:
    read = [*site.rglob("*.html"), *(site / "_static").rglob("*.css")]
    asking = {
        str(path.relative_to(site)): found.group(0)
        for path in read
        if (found := FETCHES.search(path.read_text(encoding="utf-8")))
    }

    assert len(read) > 40
    assert asking == {}


@pytest.mark.parametrize(
    "text",
    [
        '<link rel="stylesheet" href="https://fonts.example/css">',
        '<script async src="//cdn.example/x.js"></script>',
        "@import url('https://fonts.example/a.css');",
        "background: url(https://img.example/a.png)",
    ],
)
def test_what_asks_another_server_is_seen(text: str) -> None:
    assert FETCHES.search(text)
    assert not FETCHES.search('<a href="https://perfetto.dev">follow</a>')
