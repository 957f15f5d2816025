"""Many frames through one pipeline, streamed into a result on disk: in this process, in several, or on a cluster.

One frame with all its wavelengths is one piece of work, and one file for each of its images. Frames know nothing of
each other, so that the result is the same, bit by bit, whatever engine runs them, in whatever order.
"""

from oatkit.batch.engine import Engine
from oatkit.batch.engines import engine_named
from oatkit.batch.joining import join, shard_of
from oatkit.batch.running import run_frames

__all__ = ["Engine", "engine_named", "join", "run_frames", "shard_of"]
