"""Fixtures shared by the tests."""

import os
import shutil
import sys
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("OATKIT_SHARED", Path(__file__).parents[2] / "shared"))
"""A folder of real data that is not part of the repository."""


DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
WINDOWS = {"qapp", "qtbot", "make_napari_viewer", "make_napari_viewer_proxy"}
"""Fixtures that need a display."""
NO_DISPLAY = """needs a display, or Xvfb; on Debian: apt-get install xvfb libfontconfig1 libgl1 libegl1 libglib2.0-0 \
libdbus-1-3 libxkbcommon0 libxkbcommon-x11-0 libxcb-cursor0 libxcb-icccm4 libxcb-keysyms1 libxcb-shape0"""

# Nobody's own preferences, and none are written.
os.environ["NAPARI_CONFIG"] = ""
# Before anything imports Qt, which without a display would abort the whole run. pytest-xvfb starts Xvfb by itself.
NO_WINDOWS = os.environ.get("OATKIT_NO_WINDOWS") or not shutil.which("Xvfb")
if sys.platform.startswith("linux") and NO_WINDOWS and not any(os.environ.get(d) for d in DISPLAYS):
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A warning of Qt (a layer added by a thread, say) fails a test of windows."""
    for item in items:
        if WINDOWS & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.qt_log_level_fail("WARNING"))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Without a display a test of windows is skipped; in CI it fails, unless tests/run.sh could get none."""
    if not WINDOWS & set(getattr(item, "fixturenames", ())):
        return
    if os.environ.get("OATKIT_NO_WINDOWS"):
        pytest.skip(NO_DISPLAY)
    if os.environ.get("QT_QPA_PLATFORM") == "offscreen":
        (pytest.fail if os.environ.get("CI") else pytest.skip)(NO_DISPLAY)


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


@pytest.fixture(scope="session")
def small_scan():
    """A simulated scan of two frames that reconstructs in a moment: 48 detectors about a disc of 3 mm."""
    from oatkit import Geometry, plugin
    from oatkit.simulate import arc_detectors, disc, simulate_scan

    geometry = Geometry(arc_detectors(48, 0.015, 270), 20e6, 400, start_time_s=2e-6, speed_of_sound_m_s=1500)
    arc = plugin("forward_model", "arc")()
    return simulate_scan(
        lambda grid: disc(grid, radius_m=3e-3),
        arc,
        geometry=geometry,
        field_of_view_m=10e-3,
        pixels=91,
        snr_db=20.0,
        frames=2,
    )


@pytest.fixture(scope="session")
def small_scan_file(small_scan, tmp_path_factory) -> Path:
    """The same scan in a file."""
    from oatkit.scanfile import write_scan

    path = tmp_path_factory.mktemp("scan") / "small.h5"
    write_scan(small_scan, path)
    return path
