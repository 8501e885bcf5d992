"""Records that print as their table."""

from typing import Any, cast


class Tabled:
    """A record that prints as its `table`, then its `notes`."""

    def __str__(self) -> str:
        from tfarm.schema.terminal import table_lines

        return "\n".join([*table_lines(cast("Any", self).table), *getattr(self, "notes", ())])
