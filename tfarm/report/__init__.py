"""Reports: pages of pictures and tables that open from disk."""

from tfarm.report.writing import readme_pictures, write

__all__ = ["readme_pictures", "write"]
