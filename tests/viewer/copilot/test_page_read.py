"""The one-second test: at ten instants of two drives text recognition reads the page.

A judge, with Chromium at `/usr/bin/chromium`, tesseract and its German letters, and the environment
`JUDGES_VENV` with playwright and axe-playwright-python; without them it skips and says so. With
FORETWIN_DATA it also takes the Berlin drive.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from PIL import Image

from foretwin.viewer.copilot.frame import PageFrame
from foretwin.viewer.copilot.replayed import ReplayedRun
from tests.system.foretwin_command import environment, run_folder
from tests.viewer.copilot.chromium import Browser, judges_python

pytestmark = [pytest.mark.judge, pytest.mark.timeout(900)]

SIZES = ((1024, 600), (390, 844))
INSTANTS = 10


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    made = Browser()
    yield made
    made.close()


class Shown(NamedTuple):
    """A run that is over and the address at which it is shown again."""

    address: str
    run: ReplayedRun


def drives() -> dict[str, list[str]]:
    found = {"town": ["--end", "45"]}
    if data := os.environ.get("FORETWIN_DATA"):
        log = Path(data) / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt"
        town = Path(data) / "osm-berlin-mitte" / "berlin-mitte.osm"
        found["berlin"] = [
            "--map",
            str(town),
            "--log",
            str(log),
            "--source",
            "log",
            "--route",
            "from-log",
            "--end",
            "70",
        ]
    return found


@pytest.fixture(scope="module", params=["town", "berlin"])
def shown(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Shown]:
    judges_python()
    if request.param not in drives():
        pytest.skip("no FORETWIN_DATA")
    folder = tmp_path_factory.mktemp(request.param)
    foretwin = [sys.executable, "-P", "-m", "foretwin"]
    around = environment(folder / "cache")
    subprocess.run(
        [
            *foretwin,
            "drive",
            *drives()[request.param],
            "--view",
            "copilot",
            "--tuning",
            "off",
            "--out",
            str(folder / "runs"),
        ],
        env=around,
        check=False,
        timeout=500,
        capture_output=True,
    )
    run = run_folder(folder / "runs")
    assert run is not None
    with subprocess.Popen(
        [*foretwin, "watch", str(run)], env=around, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        yield Shown(next(one for one in line.split() if one.startswith("http")), ReplayedRun(run))
        process.terminate()


def instants(run: ReplayedRun) -> list[PageFrame]:
    """Return ten frames with a junction ahead, spread over the drive."""
    ahead = [one for one in run.frames.frames if one.ahead is not None and one.ahead.control]
    assert len(ahead) >= INSTANTS
    return [ahead[len(ahead) * place // INSTANTS] for place in range(INSTANTS)]


def read(picture: Path) -> str:
    """Return what text recognition reads, as it is and smaller: it knows no large type."""
    found = []
    for share in (1, 2, 3):
        smaller = picture.with_suffix(f".{share}.png")
        with Image.open(picture) as whole:
            whole.convert("L").reduce(share).save(smaller)
        for mode in ("6", "11"):
            command = ["tesseract", str(smaller), "-", "--psm", mode, "-l", "deu"]
            found.append(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return " | ".join(_letters(one) for one in found)


def _letters(text: str) -> str:
    """Return letters and digits alone; those that look alike are one."""
    text = text.casefold().replace("|", "i").translate(str.maketrans("1l058", "iiosb"))
    return "".join(letter for letter in text if letter.isalnum())


@pytest.mark.parametrize("size", SIZES, ids=["car", "phone"])
def test_in_one_second_junction_seconds_control_and_verdict_are_read(
    shown: Shown, browser: Browser, size: tuple[int, int], tmp_path: Path
) -> None:
    unread = []
    for frame in instants(shown.run):
        picture = tmp_path / f"{frame.drive_s:.1f}.png"
        browser.do("shoot", url=f"{shown.address}?at={frame.drive_s}", file=str(picture), size=size)
        text = read(picture)
        assert frame.ahead is not None
        wanted = [*frame.ahead.name.split(), frame.ahead.arrival, frame.ahead.control, frame.twin]
        unread += [
            (frame.drive_s, one) for one in wanted if _letters(one) and _letters(one) not in text
        ]
    assert unread == []


def test_key_text_is_large_and_nothing_is_cut_off(shown: Shown, browser: Browser) -> None:
    for frame in instants(shown.run):
        url = f"{shown.address}?at={frame.drive_s}"
        found = browser.do("measure", url=url, size=(1024, 600))
        for name, one in found.items():
            assert one["font_px"] >= 40, name
            assert one["inside"], (frame.drive_s, name, one)


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("size", SIZES, ids=["car", "phone"])
def test_axe_finds_nothing(
    shown: Shown, browser: Browser, theme: str, size: tuple[int, int]
) -> None:
    for frame in instants(shown.run)[::3]:
        url = f"{shown.address}?at={frame.drive_s}"
        assert browser.do("axe", url=url, size=size, theme=theme) == []
