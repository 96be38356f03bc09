"""What decides results is told: versions, and the processor with what is switched off of it."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest

from foretwin.contracts.versions import processor, versions


def test_versions_name_what_computes() -> None:
    assert versions()["python"] == platform.python_version()
    assert {"mujoco", "numpy", "numba", "foretwin"} <= versions().keys()


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
