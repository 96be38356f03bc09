"""`python -m tests.viewer.copilot.animation RUN PICTURE.png --at S --for S` makes a moving picture
(APNG) of the display as a run's drive showed it, of which the documents show one.

Needs Chromium and `JUDGES_VENV` with playwright (see `chromium.py`).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from tests.system.foretwin_command import environment
from tests.viewer.copilot.chromium import Browser

SIZE, FRAMES_PER_S, COLOURS = (1024, 600), 5, 64
MOST_BYTES = 3_000_000
"""What a page may ask of a reader's connection for one picture."""


def write_animation(pictures: Sequence[Path], out: Path, *, frames_per_s: int) -> int:
    """Write equally large pictures as one APNG that plays for ever, and return its bytes.

    All frames share one palette, so that what stands still costs nothing. Raises ValueError where
    the file would be larger than MOST_BYTES.
    """
    frames = []
    for picture in pictures:
        with Image.open(picture) as shot:
            frames.append(shot.convert("RGB"))
    all_colours = Image.fromarray(np.concatenate([np.asarray(one) for one in frames]))
    palette = all_colours.quantize(COLOURS, dither=Image.Dither.NONE)
    first, *rest = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in frames)
    first.save(
        out,
        format="PNG",
        save_all=True,
        append_images=rest,
        duration=1000 // frames_per_s,
        loop=0,
        optimize=True,
    )
    size = out.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{out}: {size} bytes are more than {MOST_BYTES}: show less of the drive")
    return size


def shoot(run: Path, folder: Path, *, at_s: float, for_s: float) -> list[Path]:
    """Return one picture after the other of the display of a run that is over."""
    found = []
    command = [sys.executable, "-P", "-m", "foretwin", "watch", str(run)]
    around = environment(folder / "cache")
    browser = Browser()
    with subprocess.Popen(command, env=around, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            address = next(one for one in line.split() if one.startswith("http"))
            for number in range(round(for_s * FRAMES_PER_S)):
                picture = folder / f"{number:04d}.png"
                url = f"{address}?at={at_s + number / FRAMES_PER_S:g}"
                browser.do("shoot", url=url, file=str(picture), size=SIZE)
                found.append(picture)
        finally:
            process.terminate()
            browser.close()
    return found


def main() -> None:
    """Make the picture that the command line asks for, and say how large it is."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("run", type=Path)
    asked.add_argument("out", type=Path)
    asked.add_argument("--at", type=float, required=True, help="seconds of the drive")
    asked.add_argument("--for", type=float, default=10.0, dest="for_s", help="seconds shown")
    given = asked.parse_args()
    with tempfile.TemporaryDirectory() as name:
        pictures = shoot(given.run, Path(name), at_s=given.at, for_s=given.for_s)
        size = write_animation(pictures, given.out, frames_per_s=FRAMES_PER_S)
    print(f"{given.out}: {len(pictures)} pictures, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
