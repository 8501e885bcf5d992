"""Records that print as their table."""

from typing import Any, cast


class Tabled:
    """A record that prints as its `table`, then its `notes`, and shows the same in a notebook."""

    def __str__(self) -> str:
        from .terminal import table_lines

        return "\n".join([*table_lines(cast("Any", self).table), *getattr(self, "notes", ())])

    def _repr_html_(self) -> str:
        from .html import as_html, with_symbols

        notes = "".join(f"<p>{with_symbols(note)}</p>" for note in getattr(self, "notes", ()))
        return as_html(cast("Any", self).table) + notes
