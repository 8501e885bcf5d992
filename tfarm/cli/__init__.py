"""The command line: arguments in, one call, output.  No arithmetic."""

from tfarm.cli.commands import app, main

__all__ = ["app", "main"]
