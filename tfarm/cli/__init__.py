"""The command line: arguments in, one call, output.  No arithmetic."""

from tfarm.cli import commands, control, reduction, sampling, trust, tuning  # noqa: F401  each adds its verbs to the application
from tfarm.cli.app import app, main

__all__ = ["app", "main"]
