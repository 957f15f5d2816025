"""The chain of Figs. 5 and 6 and Table I on a mouse: a real scan where one is given, else a simulated body."""

from dataclasses import dataclass
from functools import cached_property

from oatkit.data import Scan
from oatkit.engine import run
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import BACKGROUND_PER_CM, SCATTERING_PER_CM, lit, pipeline_for, scan_of
from oatkit.pipeline import Pipeline
from oatkit.reading import read
from oatkit.result import Result
from oatkit.simulate import Body, mouse_body


@dataclass(frozen=True)
class Mouse:
    """One slice through a mouse."""

    setting: Setting

    @property
    def real(self) -> bool:
        """Whether it is a real scan."""
        return self.setting.scan is not None

    @cached_property
    def body(self) -> Body:
        """The simulated body."""
        return mouse_body()

    @cached_property
    def scan(self) -> Scan:
        """Its signals."""
        if self.setting.scan is not None:
            return read(self.setting.scan)
        return scan_of(lambda grid: lit(self.body, grid)[0], self.setting)

    def pressure(self, preset: str) -> Result:
        """Run a preset that ends with the initial pressure over the first frame."""
        return run(Pipeline.load(preset) if self.real else pipeline_for(preset, self.setting), self.scan)

    def corrected(self, preset: str) -> Result:
        """Run a preset that ends with the absorption; the light of a simulated mouse is the one that it was made by."""
        if self.real:
            return self.pressure(preset)
        changes = (
            "fluence.use=diffusion-fvm",
            f"optics.absorption_per_cm={BACKGROUND_PER_CM}",
            f"optics.reduced_scattering_per_cm={SCATTERING_PER_CM}",
            "absorption.calibration=1.0",
        )
        return run(pipeline_for(preset, self.setting, *changes), self.scan)

    def words(self) -> str:
        """Say what it is, for a caption."""
        if self.real:
            return f"{self.scan.name}, frame 0, {self.scan.wavelengths_nm[0]:g} nm"
        return f"an invented mouse-like body; {self.setting.words()}"
