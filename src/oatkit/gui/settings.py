"""What a user may set for all windows, in napari's preferences."""

from dataclasses import dataclass, fields
from typing import Self

MB = 1_000_000


@dataclass(frozen=True)
class Settings:
    """The settings, with the defaults that the manifest shows."""

    pipeline: str = "maxent"
    """The preset that a new window begins with."""
    memory_mb: int = 256
    """Of images that steps have made, so that only what changed runs again."""
    live_preview: bool = True
    """Whether a coarse image follows the parameters while they move."""

    @classmethod
    def read(cls) -> Self:
        """Return what the user has set; where napari does not know of us (it has no manifest of ours), the defaults."""
        from napari.settings import get_plugin_settings

        try:
            known = get_plugin_settings("oatkit").windows
        except KeyError:
            return cls()
        return cls(**{entry.name: getattr(known, entry.name) for entry in fields(cls)})
