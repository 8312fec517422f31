"""Fixtures that every kind of test may use."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real flight data beside the project; their licences keep them out of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the real flight data are not beside this checkout (../shared/data)")
    return SHARED_DATA
