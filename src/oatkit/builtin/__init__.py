"""The plugins that ship with oatkit. They come in through the entry point ``oatkit``, as anybody's do.

One method per file, in a folder per kind. Nothing outside imports this package.
"""

from oatkit.api import ForwardModel, Preprocessor, Reader, Regularizer, Solver, hookimpl


@hookimpl
def oatkit_readers() -> list[type[Reader]]:
    from oatkit.builtin.readers.ithera import IThera
    from oatkit.builtin.readers.oatkit_hdf5 import OatkitHdf5

    return [IThera, OatkitHdf5]


@hookimpl
def oatkit_preprocessors() -> list[type[Preprocessor]]:
    from oatkit.builtin.preprocess.band_pass import BandPass
    from oatkit.builtin.preprocess.channels import Channels
    from oatkit.builtin.preprocess.energy import Energy
    from oatkit.builtin.preprocess.offset import Offset
    from oatkit.builtin.preprocess.transient import Transient

    return [Offset, Transient, Channels, BandPass, Energy]


@hookimpl
def oatkit_forward_models() -> list[type[ForwardModel]]:
    from oatkit.builtin.forward.arc import Arc
    from oatkit.builtin.forward.immi import Immi

    return [Arc, Immi]


@hookimpl
def oatkit_solvers() -> list[type[Solver]]:
    from oatkit.builtin.solvers.backprojection import Backprojection
    from oatkit.builtin.solvers.lsqr import Lsqr
    from oatkit.builtin.solvers.lsqr_threshold import LsqrThreshold
    from oatkit.builtin.solvers.maxent_nlcg import MaxEntNlcg
    from oatkit.builtin.solvers.nnls import Nnls

    return [Backprojection, Lsqr, LsqrThreshold, Nnls, MaxEntNlcg]


@hookimpl
def oatkit_regularizers() -> list[type[Regularizer]]:
    from oatkit.builtin.regularizers.entropy import Entropy
    from oatkit.builtin.regularizers.identity import Identity
    from oatkit.builtin.regularizers.laplacian import Laplacian

    return [Entropy, Identity, Laplacian]
