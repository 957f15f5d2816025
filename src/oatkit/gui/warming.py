"""What is slow only the first time is done beside the window, before the user asks for it."""

from collections.abc import Iterator

from oatkit.engine import run
from oatkit.gui.job import Job
from oatkit.gui.samples import arc
from oatkit.pipeline import Pipeline

CHANGES = ("grid.pixels=16", "grid.field_of_view_mm=5", "reconstruct.n_iterations=1")


def warm_up() -> Job:
    """Start a job that imports and compiles what a reconstruction needs: a tiny one runs."""

    def work(job: Job) -> Iterator[None]:
        from oatkit.data import Geometry
        from oatkit.simulate import arc_detectors, disc, simulate_scan

        geometry = Geometry(arc_detectors(4, 0.01, 270), 20e6, 128, 4e-6, 1500.0)
        job.check()
        scan = simulate_scan(
            lambda grid: disc(grid, radius_m=1e-3), arc(), geometry=geometry,
            field_of_view_m=4e-3, pixels=11,
        )  # fmt: skip
        job.check()
        run(Pipeline.load("maxent", CHANGES), scan)
        yield

    return Job(work).start()
