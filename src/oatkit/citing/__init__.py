"""What to cite for the images of a pipeline, as BibTeX."""

from oatkit.citing.pipeline import bibtex

__all__ = ["bibtex"]
