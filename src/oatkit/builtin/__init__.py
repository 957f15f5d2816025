"""The plugins that ship with oatkit. They come in through the entry point ``oatkit``, as anybody's do.

One method per file, in a folder per kind. Nothing outside imports this package.
"""

from oatkit.api import (
    FluenceModel,
    ForwardModel,
    Preprocessor,
    Reader,
    Regularizer,
    Segmenter,
    Solver,
    Unmixer,
    hookimpl,
)


@hookimpl
def oatkit_readers() -> list[type[Reader]]:
    from oatkit.builtin.readers.ipasc import Ipasc
    from oatkit.builtin.readers.ithera import IThera
    from oatkit.builtin.readers.oatkit_hdf5 import OatkitHdf5
    from oatkit.builtin.readers.patato import Patato
    from oatkit.builtin.readers.plain_array import PlainArray

    return [Ipasc, IThera, OatkitHdf5, Patato, PlainArray]


@hookimpl
def oatkit_preprocessors() -> list[type[Preprocessor]]:
    from oatkit.builtin.preprocess.band_pass import BandPass
    from oatkit.builtin.preprocess.channels import Channels
    from oatkit.builtin.preprocess.energy import Energy
    from oatkit.builtin.preprocess.invert import Invert
    from oatkit.builtin.preprocess.offset import Offset
    from oatkit.builtin.preprocess.transient import Transient

    return [Offset, Transient, Channels, BandPass, Energy, Invert]


@hookimpl
def oatkit_forward_models() -> list[type[ForwardModel]]:
    from oatkit.builtin.forward.arc import Arc
    from oatkit.builtin.forward.immi import Immi

    return [Arc, Immi]


@hookimpl
def oatkit_solvers() -> list[type[Solver]]:
    from oatkit.builtin.solvers.backprojection import Backprojection
    from oatkit.builtin.solvers.l1 import L1Solver
    from oatkit.builtin.solvers.lsqr import Lsqr
    from oatkit.builtin.solvers.lsqr_threshold import LsqrThreshold
    from oatkit.builtin.solvers.maxent_nlcg import MaxEntNlcg
    from oatkit.builtin.solvers.nnls import Nnls
    from oatkit.builtin.solvers.tv import TvSolver

    return [Backprojection, Lsqr, LsqrThreshold, Nnls, MaxEntNlcg, L1Solver, TvSolver]


@hookimpl
def oatkit_regularizers() -> list[type[Regularizer]]:
    from oatkit.builtin.regularizers.entropy import Entropy
    from oatkit.builtin.regularizers.identity import Identity
    from oatkit.builtin.regularizers.l1 import L1
    from oatkit.builtin.regularizers.laplacian import Laplacian
    from oatkit.builtin.regularizers.tv import TotalVariation

    return [Entropy, Identity, Laplacian, L1, TotalVariation]


@hookimpl
def oatkit_fluence_models() -> list[type[FluenceModel]]:
    from oatkit.builtin.fluence.beer_lambert import BeerLambert
    from oatkit.builtin.fluence.diffusion_fvm import DiffusionFvm

    return [BeerLambert, DiffusionFvm]


@hookimpl
def oatkit_segmenters() -> list[type[Segmenter]]:
    from oatkit.builtin.segmenters.active_contour import ActiveContour
    from oatkit.builtin.segmenters.geodesic import Geodesic
    from oatkit.builtin.segmenters.mask import Mask
    from oatkit.builtin.segmenters.polygon import Polygon
    from oatkit.builtin.segmenters.radial import Radial

    return [ActiveContour, Radial, Geodesic, Mask, Polygon]


@hookimpl
def oatkit_unmixers() -> list[type[Unmixer]]:
    from oatkit.builtin.unmixers.fluence_corrected import FluenceCorrected
    from oatkit.builtin.unmixers.lstsq import LstsqUnmixer
    from oatkit.builtin.unmixers.nnls import NnlsUnmixer

    return [NnlsUnmixer, LstsqUnmixer, FluenceCorrected]
