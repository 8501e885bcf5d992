"""The sampled loop is in `tfarm.loop.sampled`; this is its module of version 1.0."""

from tfarm.moved import moved

__getattr__ = moved(__name__, dict.fromkeys(("Sampled", "sampled_loop"), "tfarm.loop.sampled"))
