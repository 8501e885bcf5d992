"""Reports: pages of pictures and tables that open from disk."""

from tfarm.report.writing import write

__all__ = ["write"]
