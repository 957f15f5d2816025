"""The demo: simulated scans, and what becomes of them, each beside the truth."""

from oatkit.demo.running import run_demo
from oatkit.demo.scans import simulated, simulated_oxygen

__all__ = ["run_demo", "simulated", "simulated_oxygen"]
