"""The command line. Every command calls what a script would call.

Exit codes: 0 done, 1 the result could not be written, 2 usage or invalid pipeline, 3 some frames failed,
4 unreadable input, 130 interrupted.
"""

import logging
import signal

# Each registers its commands, which --help lists in this order.
# isort: off
from oatkit.cli import showcase, scans, results, regions, series, windows, catalogue, authoring  # noqa: F401

# isort: on
from oatkit.cli.app import Complaints, app, interrupt, terminate


def main() -> None:
    """Run the command line; asked to end, by SIGTERM or a closed terminal, it cleans up behind itself."""
    signal.signal(signal.SIGINT, interrupt)
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), terminate)
    logging.getLogger("oatkit").addHandler(Complaints())
    app()
