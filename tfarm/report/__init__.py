"""Reports: pages of pictures and tables that open from disk."""

from tfarm.report.pictures import readme_pictures
from tfarm.report.writing import write

__all__ = ["readme_pictures", "write"]
