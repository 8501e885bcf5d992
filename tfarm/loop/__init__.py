"""The continuous loop of the exact arm: poles, verdicts, windows of gains, margins, maps, loci, Lyapunov.

Import from its modules: `from tfarm.loop.margins import margins`.
"""
