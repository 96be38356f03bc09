"""`convert` writes a whole drive, or nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.logs.convert import NO_ROS_MESSAGE, convert
from foretwin.telemetry.logs.write_csv import DECLARATION_MARK
from tests.telemetry.test_drive_mcap import assert_same

GOOD = "point3 {} 3784144.3 901246.3 5037714.1 0 0 0 0 0 0 0 0 0\n"


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name",
    ["drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt", "drive-comma2k19-sf/segment40"],
)
def test_real_drives_come_back_the_same(data_dir: Path, tmp_path: Path, name: str) -> None:
    source = open_log(data_dir / name)
    report = convert(data_dir / name, tmp_path / "drive.mcap")
    back = open_log(tmp_path / "drive.mcap")
    before, after = list(source.samples()), list(back.samples())
    assert sum(report.counts.values()) == len(before) == len(after)
    for (channel, message), (channel_back, message_back) in zip(before, after, strict=True):
        assert channel_back == channel
        assert_same(message, message_back)
    assert back.info == source.info


def test_what_is_refused_is_reported(tmp_path: Path) -> None:
    source = tmp_path / "gt.txt"
    source.write_text(GOOD.format(0) + "point3 0.5 0 0 0\n" + GOOD.format(1))
    report = convert(source, tmp_path / "gt.mcap")
    assert report.counts == {"gnss": 2}
    assert report.skipped == {"position not finite": 1}


@pytest.mark.parametrize("name", ["gt.mcap", "gt.bag", "bag"])
def test_a_stamp_that_no_ros_time_holds_costs_its_sample(tmp_path: Path, name: str) -> None:
    source, far = tmp_path / "gt.txt", GOOD.format(2_540_000_000)
    source.write_text(GOOD.format(0) + far)
    report = convert(source, tmp_path / name)
    assert (report.counts, report.skipped) == ({"gnss": 1}, {NO_ROS_MESSAGE: 1})
    assert [channel for channel, _ in open_log(tmp_path / name).samples()] == ["gnss"]
    source.write_text(far)
    with pytest.raises(LogError, match=f"holds no valid sample \\(1 x {NO_ROS_MESSAGE}"):
        convert(source, tmp_path / f"other{name}")


def test_nothing_is_left_behind_where_nothing_is_valid(tmp_path: Path) -> None:
    source = tmp_path / "gt.txt"
    source.write_text("point3 0.5 0 0 0\n")
    with pytest.raises(LogError, match=r"gt\.txt: holds no valid sample \(1 x position not fin"):
        convert(source, tmp_path / "gt.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["gt.txt"]


def test_an_earlier_file_stays_when_converting_fails(tmp_path: Path) -> None:
    target = tmp_path / "gt.mcap"
    target.write_text("precious")
    with pytest.raises(FileNotFoundError):
        convert(tmp_path / "missing.txt", target)
    assert target.read_text() == "precious"


def test_a_drive_is_not_converted_onto_itself(tmp_path: Path) -> None:
    source = tmp_path / "gt.txt"
    source.write_text(GOOD.format(0))
    convert(source, tmp_path / "gt.mcap")
    with pytest.raises(LogError, match="is the log itself"):
        convert(tmp_path / "gt.mcap", tmp_path / "gt.mcap")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A CSV with a declaration that somebody wrote."""
    source = tmp_path / "gt.txt"
    source.write_text(GOOD.format(0) + GOOD.format(1))
    convert(source, tmp_path / "mine.csv")
    declaration = tmp_path / "mine.csv.toml"
    mark, _, rest = declaration.read_text().partition("\n")
    assert mark.startswith(DECLARATION_MARK)
    declaration.write_text("# by hand\n" + rest)
    return tmp_path / "mine.csv"


def test_the_declaration_that_is_read_is_never_written_over(table: Path) -> None:
    declaration = table.with_name("mine.csv.toml")
    other = table.rename(table.with_name("other.csv"))
    with pytest.raises(LogError, match=r"mine\.csv\.toml: is the declaration of the log"):
        convert(other, table, declaration=declaration)
    declaration.rename(table.with_name("other.csv.toml"))
    with pytest.raises(LogError, match=r"other\.csv\.toml: is the declaration of the log"):
        convert(other, table.with_name("other.csv.toml"), to="csv")
    with pytest.raises(LogError, match=r"other\.csv\.toml: is the declaration of the log"):
        convert(other, table.with_name("other.csv.toml"), to="mcap")
    assert table.with_name("other.csv.toml").read_text().startswith("# by hand")
    assert not table.exists()


def test_only_declarations_that_it_wrote_are_replaced(table: Path) -> None:
    source, before = table.with_name("gt.txt"), table.read_bytes()
    declaration = table.with_name("mine.csv.toml")
    with pytest.raises(LogError, match=r"mine\.csv\.toml: would be replaced"):
        convert(source, table)
    assert declaration.read_text().startswith("# by hand")
    assert table.read_bytes() == before
    convert(source, table.with_name("own.csv"))
    convert(source, table.with_name("own.csv"))


def test_a_folder_is_no_target(table: Path) -> None:
    (table.parent / "folder.mcap").mkdir()
    with pytest.raises(LogError, match=r"folder\.mcap: is a folder; name a file"):
        convert(table, table.parent / "folder.mcap")


def test_a_declaration_that_is_missing_or_of_no_use_is_told(table: Path) -> None:
    source, recording = table.with_name("gt.txt"), table.with_name("gt.mcap")
    convert(source, recording)
    for log in (source, recording, table):
        with pytest.raises(FileNotFoundError, match=r"declaration .*none\.toml: no such file"):
            open_log(log, declaration=table.with_name("none.toml"))
    declaration = table.with_name("mine.csv.toml")
    with pytest.raises(LogError, match=r"gt\.txt: smartLoc's .* leave out --declaration"):
        open_log(source, declaration=declaration)
    with pytest.raises(LogError, match=r"gt\.mcap: foretwin's own .* leave out --declaration"):
        open_log(recording, declaration=declaration)
