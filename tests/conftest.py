"""Fixtures shared by the tests."""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("OATKIT_SHARED", Path(__file__).parents[2] / "shared"))
"""A folder of real data that is not part of the repository."""


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scans, array geometries and phantoms; the test is skipped where it is absent."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip("needs the real data, which are not part of the repository; set OATKIT_SHARED to their folder")
    return folder


@pytest.fixture(scope="session")
def mouse_scan(shared_data: Path) -> Path:
    """The real scan of a mouse by an iThera MSOT scanner: one frame at 700 nm."""
    return shared_data / "mouse_scan9" / "Scan_9.msot"
