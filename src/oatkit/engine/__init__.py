"""The one engine: words replaced by numbers, then a generator of events over the steps of one frame."""

from oatkit.engine.running import describe_scan, run, run_resolved

__all__ = ["describe_scan", "run", "run_resolved"]
