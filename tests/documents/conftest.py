"""The environment that pages are played in: built once, as it costs a wheel and a drive."""

from __future__ import annotations

import pytest

from tests.documents.stage import Installed, install


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return install(tmp_path_factory.mktemp("installed"))
