"""The exception tree: each class is a different thing for the user to do next.

Every message is one sentence that says where, what was found and what was expected.
"""


class OatkitError(Exception):
    """Anything that oatkit reports to its user, as opposed to a fault in oatkit."""


class ReadError(OatkitError):
    """A file could not be read: missing, damaged, hostile, or not of the format it claims."""


class ValidationError(OatkitError, ValueError):
    """A value is outside what it may be: a parameter, a pipeline file, an array handed in."""


class PluginError(OatkitError):
    """A plugin is missing, broken, ambiguous, or returned something that it may not."""


class SolverError(OatkitError):
    """A solver could not produce a finite image."""


class ResultError(OatkitError):
    """A result could not be written, or is damaged or incomplete."""
