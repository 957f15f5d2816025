"""A package for a new plugin, written on the spot: it installs, is listed and passes its tests at once.

What is written comes from ``templates``: a few files that all kinds share, and in a folder for each kind the method
itself, a test of it, and what the package's README says about its use.
"""

from oatkit.scaffold.writing import new_plugin

__all__ = ["new_plugin"]
