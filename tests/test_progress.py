"""The progress bar shows what the engine tells."""

import numpy as np
import pytest

from oatkit.api import Iterate
from oatkit.cli.progress import ProgressBar
from oatkit.events import StepDone, StepIterate, StepStarted


class Terminal:
    """A stream that says that it is a terminal and keeps what is written."""

    def __init__(self):
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self): ...


def show(*events) -> None:
    """Let a bar show events."""
    with ProgressBar(frames=2) as bar:
        for event in events:
            bar.show(event)
        bar.next_frame()


def test_a_terminal_sees_step_wavelength_residual_and_gap(monkeypatch):
    """On a terminal the bar names the step, the wavelength, the residual and the certificate."""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    state = Iterate(np.zeros((2, 2)), 7, residual_norm=0.5, relative_gap=1e-3)
    waiting = Iterate(np.zeros((2, 2)), 0)
    show(
        StepStarted("reconstruct"),
        StepIterate("reconstruct", 700.0, waiting),
        StepIterate("reconstruct", 700.0, state),
        StepDone("reconstruct", 1.0, {}),
    )
    for word in ("reconstruct", "700 nm, setting the scale", "step 7, residual 0.5, gap 1.0e-03", "0/2"):
        assert word in terminal.text


@pytest.mark.parametrize("stream", [None, open])
def test_without_a_terminal_there_is_no_bar(monkeypatch, tmp_path, stream):
    """Where stderr is a file, or closed, nothing is shown and nothing fails."""
    path = tmp_path / "errors.txt"
    target = path.open("w") if stream else None
    monkeypatch.setattr("sys.stderr", target)
    show(StepStarted("reconstruct"))
    if target:
        target.close()
        assert path.read_text() == ""
