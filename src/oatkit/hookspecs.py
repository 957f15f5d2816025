"""The hooks, one for each kind of plugin: the plugin author's manual.

A hook takes no argument and returns a list of classes. Import heavy things inside it, or inside the methods of the
class: declaring a plugin is then free. The package names the module with its hooks in ``pyproject.toml``::

    [project.entry-points.oatkit]
    sirt = "oatkit_sirt"
"""

import pluggy

from oatkit.api import FluenceModel, ForwardModel, Preprocessor, Reader, Regularizer, Segmenter, Solver, Unmixer

hookspec = pluggy.HookspecMarker("oatkit")


@hookspec
def oatkit_readers() -> list[type[Reader]]:  # type: ignore[empty-body]
    """Return readers of scan files::

    class Wav(Reader):
        name = "wav"

        def can_read(self, path):
            return path.suffix == ".wav"

        def read(self, path): ...
    """


@hookspec
def oatkit_preprocessors() -> list[type[Preprocessor]]:  # type: ignore[empty-body]
    """Return steps between the raw and the clean signals::

    class Invert(Preprocessor):
        name = "invert"

        def process(self, scan):
            return replace(scan, signals=-np.asarray(scan.signals, float))
    """


@hookspec
def oatkit_forward_models() -> list[type[ForwardModel]]:  # type: ignore[empty-body]
    """Return acoustic models::

    class Matrix(ForwardModel):
        name = "matrix"

        def operator(self, geometry, grid):
            return aslinearoperator(build(geometry, grid))
    """


@hookspec
def oatkit_solvers() -> list[type[Solver]]:  # type: ignore[empty-body]
    """Return reconstructions::

    class Landweber(Solver):
        name = "landweber"
        n_iterations: int = param(500, "largest number of steps", at_least=1)

        def iterate(self, problem):
            x = np.zeros(problem.shape)
            for products, _ in enumerate(problem.settle_norm(), 1):  # finds |A|; can be cancelled meanwhile
                yield Iterate(x, 0, products=products)
            for i in range(1, self.n_iterations + 1):
                step = problem.adjoint(problem.data - problem.forward(x)) / (problem.norm**2 or 1)
                x = x + step
                still = bool(np.linalg.norm(step) <= 1e-4 * np.linalg.norm(x))
                reason = "raise n_iterations" if i == self.n_iterations and not still else ""
                yield Iterate(x, i, products=problem.norm_products + i, converged=still, reason=reason)
                if still:
                    return
    """


@hookspec
def oatkit_regularizers() -> list[type[Regularizer]]:  # type: ignore[empty-body]
    """Return penalties, derived from the abilities that they have::

    class Ridge(Quadratic, Proximable):
        name = "ridge"

        def value(self, image):
            return float((image**2).sum())

        def operator(self, shape):
            return identity_of(shape)

        def prox(self, image, step):
            return image / (1 + 2 * step)
    """


@hookspec
def oatkit_segmenters() -> list[type[Segmenter]]:  # type: ignore[empty-body]
    """Return ways to find the body::

    class Circle(Segmenter):
        name = "circle"
        radius: float = param(10.0, "radius about the centre", unit="mm", above=0)

        def segment(self, image):
            y, x = np.meshgrid(image.grid.y_m, image.grid.x_m, indexing="ij")
            return Image(np.hypot(y, x) - self.radius * 1e-3, "boundary", "m", image.grid)
    """


@hookspec
def oatkit_fluence_models() -> list[type[FluenceModel]]:  # type: ignore[empty-body]
    """Return models of light::

    class Exponential(FluenceModel):
        name = "exponential"

        def fluence(self, boundary, optics):
            depth = np.maximum(-boundary.values, 0)
            light = np.exp(-optics.absorption_per_m[:, None, None] * depth)
            return Image(light, "fluence", "", boundary.grid, optics.wavelengths_nm)
    """


@hookspec
def oatkit_unmixers() -> list[type[Unmixer]]:  # type: ignore[empty-body]
    """Return ways from wavelengths to chromophores::

    class Difference(Unmixer):
        name = "difference"

        def unmix(self, problem):
            p = problem.initial_pressure
            change = p.values[-1] - p.values[0]
            return {"difference": Image(change, "difference", p.unit, p.grid)}
    """
