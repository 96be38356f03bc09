"""The moving picture of the documents: what it shows, how long, and that it stays small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from tests.viewer.copilot import animation
from tests.viewer.copilot.animation import MOST_BYTES, write_animation

DOCUMENTS = Path(__file__).parents[3] / "docs"


def picture(folder: Path, name: str, pixels: np.ndarray) -> Path:
    Image.fromarray(pixels.astype(np.uint8)).save(folder / name)
    return folder / name


def test_pictures_become_one_that_plays_for_ever(tmp_path: Path) -> None:
    shots = []
    for number in range(3):
        pixels = np.zeros((40, 60, 3))
        pixels[:, 20 * number :] = (255, 128, 0)
        shots.append(picture(tmp_path, f"{number}.png", pixels))

    size = write_animation(shots, tmp_path / "moving.png", frames_per_s=5)

    with Image.open(tmp_path / "moving.png") as moving:
        assert (moving.format, moving.info.get("loop", 0)) == ("PNG", 0)
        frames = ImageSequence.all_frames(moving)
        assert len(frames) == 3
        for number, frame in enumerate(frames):
            assert frame.info["duration"] == pytest.approx(200)
            row = np.asarray(frame.convert("RGB"))[10]
            assert (row == [[0, 0, 0]] * 20 * number + [[255, 128, 0]] * (60 - 20 * number)).all()
    assert size == (tmp_path / "moving.png").stat().st_size


def test_a_picture_too_large_for_a_page_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_BYTES == 3_000_000
    monkeypatch.setattr(animation, "MOST_BYTES", 1000)
    noise = np.random.default_rng(0).integers(0, 256, (2, 60, 60, 3))
    shots = [picture(tmp_path, f"{n}.png", one) for n, one in enumerate(noise)]
    with pytest.raises(ValueError, match="more than 1000: show less"):
        write_animation(shots, tmp_path / "moving.png", frames_per_s=5)


def test_the_documents_show_ten_seconds() -> None:
    with Image.open(DOCUMENTS / "copilot-ten-seconds.png") as moving:
        assert moving.size == (1024, 600)
        shown_ms = [one.info["duration"] for one in ImageSequence.Iterator(moving)]
    assert sum(shown_ms) == pytest.approx(10_000)
