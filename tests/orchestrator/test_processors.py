"""How many workers may be asked for, by what the machine has."""

from __future__ import annotations

import pytest

from foretwin.orchestrator import processors
from foretwin.orchestrator.config import ConfigError
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.processors import most_workers, trouble_with_workers


@pytest.mark.parametrize(("there", "most"), [(1, 16), (4, 16), (5, 20), (64, 256)])
def test_workers_are_bounded_by_processors(
    monkeypatch: pytest.MonkeyPatch, there: int, most: int
) -> None:
    monkeypatch.setattr(processors, "processors", lambda: there)
    assert most_workers() == most
    assert trouble_with_workers(1) is None is trouble_with_workers(most)
    for wrong in (0, most + 1):
        said = f"--workers {wrong}: 1 to {most} here, 4 a processor and never fewer than 16"
        assert trouble_with_workers(wrong) == said


def test_a_drive_of_very_many_workers_is_refused() -> None:
    with pytest.raises(ConfigError, match="--workers 100000: 1 to"):
        load_config(None, {"workers": 100_000})
