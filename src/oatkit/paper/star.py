"""The star phantom of Figs. 2, 3 and S1 and Table I: two tubes of ink in agar, one deep, one near the surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oatkit.api import Problem
from oatkit.data import Grid, Image, Scan
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import light_model, lit_by_itself, pipeline_for, problem_of, scan_of
from oatkit.simulate import Body, star_body

SCATTERING_PER_CM = 10.0
"""mu_s' assumed of the agar; the paper gives 7 % of Intralipid by volume and no coefficient."""
AGAR_PER_CM = 0.25
TUBE_PER_CM = 2.5
RADIUS_M = 9e-3
TUBES_M = ((0.0, 0.0), (0.68 * RADIUS_M, 0.0))
"""Centres (y, x) of the deep and of the shallow tube."""
CORE_M = 0.7 * 0.11 * RADIUS_M
"""Radius within which a tube is read, off its blurred edge."""


@dataclass(frozen=True)
class Star:
    """The phantom at one setting, with its data."""

    setting: Setting
    shadows: bool = True
    """Whether the tubes dim the light, or it is that of agar alone."""

    @cached_property
    def body(self) -> Body:
        """The phantom."""
        return star_body(RADIUS_M)

    @cached_property
    def truth(self) -> tuple[Image, Image]:
        """Initial pressure and fluence on the grid of the reconstruction."""
        return self.lit(self.setting.grid)

    def lit(self, grid: Grid) -> tuple[Image, Image]:
        """Return initial pressure and fluence on any grid."""
        if self.shadows:
            return lit_by_itself(self.body, grid, SCATTERING_PER_CM)
        return self.body.lit(grid, light_model(), 100 * SCATTERING_PER_CM, 100 * AGAR_PER_CM)

    @cached_property
    def scan(self) -> Scan:
        """Its noisy signals."""
        return scan_of(lambda grid: self.lit(grid)[0], self.setting)

    @cached_property
    def problem(self) -> Problem:
        """The inverse problem of its signals."""
        return problem_of(pipeline_for("lsqr", self.setting), self.scan)

    @cached_property
    def inside(self) -> np.ndarray:
        """Which pixels lie in the phantom."""
        return self.body.boundary(self.setting.grid).values[0] < 0

    def tubes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return which pixels lie in the core of the deep and of the shallow tube."""
        y, x = np.meshgrid(self.setting.grid.y_m, self.setting.grid.x_m, indexing="ij")
        deep, shallow = (np.hypot(y - cy, x - cx) <= CORE_M for cy, cx in TUBES_M)
        return deep, shallow

    def ratio(self, image: Image) -> float:
        """Return the mean of the deep tube over that of the shallow one; 1 in truth."""
        deep, shallow = (image.values[0][tube].mean() for tube in self.tubes())
        return float(deep / shallow)
