"""A progress bar for a terminal; nothing where the output is no terminal."""

import sys
from typing import Any

from oatkit.events import Event, StepDone, StepIterate, StepStarted


class ProgressBar:
    """Shows the events of the engine on one line of the terminal; a context manager."""

    def __init__(self, frames: int = 1) -> None:
        from tqdm import tqdm  # only for a terminal

        self.bar = tqdm(
            total=frames, unit="frame", disable=not (sys.stderr and sys.stderr.isatty()), file=sys.stderr, leave=False
        )

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *exception: Any) -> None:
        self.bar.close()

    def show(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, StepStarted):
            self.bar.set_description_str(event.step)
        elif isinstance(event, StepIterate):
            self.bar.set_postfix_str(_iterate_text(event), refresh=True)
        elif isinstance(event, StepDone):
            self.bar.set_postfix_str("", refresh=False)

    def next_frame(self) -> None:
        """Say that a frame is finished."""
        self.bar.update()


def _iterate_text(event: StepIterate) -> str:
    iterate = event.iterate
    if iterate.iteration == 0:
        return f"{event.wavelength_nm:g} nm, setting the scale"
    parts = [f"{event.wavelength_nm:g} nm", f"step {iterate.iteration}", f"residual {iterate.residual_norm:.3g}"]
    if iterate.relative_gap == iterate.relative_gap:  # not NaN
        parts.append(f"gap {iterate.relative_gap:.1e}")
    return ", ".join(parts)
