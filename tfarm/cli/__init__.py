"""The command line: arguments in, one call, output.  No arithmetic."""

from tfarm.cli import (  # noqa: F401  each adds its verbs to the application
    commands,
    control,
    loops,
    reduction,
    sampling,
    studies,
    trust,
    tuning,
)
from tfarm.cli.app import app, main

__all__ = ["app", "main"]
