"""An anchor file is read whole or refused in one line that names the key."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foretwin.contracts import anchor_file
from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.anchor_file import anchor_text, read_anchor
from foretwin.contracts.errors import UserError

EXAMPLE = (anchor_file.__doc__ or "").split("```toml\n")[1].split("```")[0]
FENCE = re.compile(r"^fence = .*$", re.MULTILINE)


def written(folder: Path, text: str) -> Path:
    file = folder / "lot.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_example_says_where_the_lot_and_the_world_are(tmp_path: Path):
    read = read_anchor(written(tmp_path, EXAMPLE))
    assert read.lot is not None
    assert (read.lot.lat_deg, read.world.lat_deg, len(read.fence)) == (52.4739, 52.5113, 4)
    assert (read.anchor.scale, read.anchor.mirrored) == (1.0, False)
    assert read.anchor.lot == read.lot
    assert read.anchor.world == read.world


def test_without_scale_and_fence_it_is_the_same_size_and_has_no_end(tmp_path: Path):
    text = "".join(EXAMPLE.partition("[lot]")[1:])
    read = read_anchor(written(tmp_path, text))
    assert (read.scale, read.mirrored, read.fence) == (1.0, False, ())


@pytest.mark.parametrize(
    ("fence", "says"),
    [
        ("[[52.47, 13.38], [52.48, 13.40]]", "2 corners; 3 to 1000 are needed"),
        (str([[52.47, 13.38]] * 1001), "1001 corners; 3 to 1000 are needed"),
        ("[[152.47, 13.38], [52.48, 13.40], [52.47, 13.41]]", "degrees"),
        ("[[52.47, 13.38], [52.48, 13.41], [52.48, 13.38], [52.47, 13.41]]", "sides cross"),
        ("[[52.47, 13.38], [52.47, 13.41], [52.47, 13.39]]", "sides cross"),
        ("[[52.50, 13.38], [52.51, 13.38], [52.51, 13.40]]", "outside"),
    ],
)
def test_a_fence_that_is_none_is_refused(tmp_path: Path, fence: str, says: str):
    file = written(tmp_path, FENCE.sub(f"fence = {fence}", EXAMPLE))
    with pytest.raises(UserError, match=says) as wrong:
        read_anchor(file)
    assert "line 3" in str(wrong.value)


def test_what_no_anchor_has_is_refused_with_its_line(tmp_path: Path):
    with pytest.raises(UserError, match=r"scale 0\.0"):
        read_anchor(written(tmp_path, EXAMPLE.replace("scale = 1.0 ", "scale = 0.0 ")))
    with pytest.raises(UserError, match="yaw_degrees"):
        read_anchor(written(tmp_path, EXAMPLE.replace("yaw_deg ", "yaw_degrees ")))
    with pytest.raises(FileNotFoundError):
        read_anchor(tmp_path / "none.toml")


NO_LOT = EXAMPLE.replace(EXAMPLE[EXAMPLE.index("[lot]") : EXAMPLE.index("[world]")], "")


def test_a_lot_that_is_not_known_yet_is_for_who_asks_the_car_alone(tmp_path: Path):
    file = written(tmp_path, NO_LOT)
    with pytest.raises(UserError, match=r"\[lot\] is missing"):
        read_anchor(file)
    read = read_anchor(file, first_pose=True)
    assert read.lot is None
    with pytest.raises(ValueError, match="first settled pose"):
        _ = read.anchor
    whole = read_anchor(written(tmp_path, EXAMPLE))
    assert whole.lot is not None
    assert read.at_lot(whole.lot) == whole


def test_a_first_pose_outside_of_the_fence_is_refused(tmp_path: Path):
    read = read_anchor(written(tmp_path, NO_LOT), first_pose=True)
    with pytest.raises(UserError, match=r"first pose 52\.5000000, 13\.4000000: fence: .* outside"):
        read.at_lot(AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0))


def test_it_is_written_as_it_is_read(tmp_path: Path):
    for text in (EXAMPLE, NO_LOT, EXAMPLE.replace("false", "true"), FENCE.sub("", EXAMPLE)):
        read = read_anchor(written(tmp_path, text), first_pose=True)
        again = read_anchor(written(tmp_path, anchor_text(read)), first_pose=True)
        assert again == read
