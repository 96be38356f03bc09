"""`python -m foretwin.viewer --open` and its errors: one line each, exit code 2."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from foretwin.viewer import showing as viewer
from foretwin.viewer.__main__ import main
from foretwin.viewer.live_viewer import offline_environment

COVERS = ("foretwin.viewer.showing",)


def test_a_missing_recording_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--open", str(tmp_path / "monitor.rrd")]) == 2
    assert capsys.readouterr().err == f"viewer: no recording {tmp_path / 'monitor.rrd'}\n"


@pytest.mark.skipif("sys.platform != 'linux'", reason="displays are named in the environment")
def test_without_a_display_a_picture_is_offered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    recording = tmp_path / "monitor.rrd"
    recording.write_bytes(b"RRF2")
    assert main(["--open", str(recording)]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "foretwin.viewer.picture" in told


def test_all_parts_of_a_recording_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "is_complete", lambda recording: True)
    monkeypatch.setattr(os, "execve", lambda program, arguments, _: shown.extend(arguments))
    parts = [tmp_path / name for name in ("monitor.rrd", "monitor-002.rrd")]
    for part in parts:
        part.write_bytes(b"RRF2")
    viewer.show(parts[0])
    assert shown[-2:] == [str(part) for part in parts]


def test_the_viewer_is_kept_from_the_internet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("https_proxy", "http://proxy.example:3128")
    environment = offline_environment()
    for name in ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "https_proxy"):
        assert environment[name] == "http://127.0.0.1:9"
    assert "127.0.0.1" in environment["NO_PROXY"]


def test_another_layout_is_laid_over_a_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(viewer, "is_complete", lambda recording: True)
    monkeypatch.setattr(viewer, "serve_recordings", lambda parts: shown.extend(map(str, parts)))
    monkeypatch.setattr(viewer, "copy_with_blueprint", lambda source, copy, blueprint: None)
    recording = tmp_path / "monitor.rrd"
    recording.write_bytes(b"RRF2")
    for layout in (None, "gap", "drive"):
        viewer.show(recording, layout=layout, view="web")
    assert shown[0] == str(recording)
    for copy in shown[1:]:
        assert Path(copy).name == recording.name
        assert Path(copy) != recording
