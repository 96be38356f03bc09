"""What decides results is told: versions, and the processor with what is switched off of it."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path

import pytest

from foretwin.contracts.versions import _found, processor, versions


def test_versions_name_what_computes() -> None:
    assert versions()["python"] == platform.python_version()
    assert {"mujoco", "numpy", "numba", "foretwin"} <= versions().keys()


def test_what_is_not_installed_is_told_to_be_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name == "osmium":
            raise importlib.metadata.PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr(importlib.metadata, "version", version)
    found = _found.__wrapped__()
    assert (found["osmium"], found["numpy"]) == ("not installed as a package", "1.0")


def test_a_processor_is_told_by_its_model_and_what_is_switched_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor\t: 0\nmodel name\t: Ryzen 9\nmodel name\t: Ryzen 9\n")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "AVX2")
    monkeypatch.delenv("NUMBA_CPU_NAME", raising=False)
    told = f"{platform.machine()} Ryzen 9 NPY_DISABLE_CPU_FEATURES=AVX2"
    assert processor(cpuinfo) == told
    assert processor(tmp_path / "none").startswith(platform.machine())
