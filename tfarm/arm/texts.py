"""The texts of an arm: its name, which is also a folder's, and its assumptions."""

from __future__ import annotations

from tfarm.errors import ParameterError

MOST_NAME_BYTES = 200  # in UTF-8: file systems stop at 255, and a temporary file's name is longer than its own
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in "0123456789¹²³")}


def plain_name(name: object) -> str:
    """The name, which is also the name of the arm's folder of reports, on every file system."""
    remedy = 'a name has 1 to 80 characters, begins with a letter or digit and has no / \\ : * ? " < > |'
    if not isinstance(name, str) or not 1 <= len(name) <= 80 or not name.isprintable():
        raise ParameterError(key="name", value=name, remedy=remedy)
    if not name[0].isalnum() or name[-1] in " ." or set(name) & set('/\\:*?"<>|'):
        raise ParameterError(key="name", value=name, remedy=remedy)
    if len(name.encode()) > MOST_NAME_BYTES:
        raise ParameterError(key="name", value=name, remedy=f"{len(name.encode())} bytes; at most {MOST_NAME_BYTES}")
    if name.partition(".")[0].rstrip().casefold() in DEVICES:
        raise ParameterError(key="name", value=name, remedy="is a device to Windows; give the arm another name")
    return name


def plain_texts(assumptions: object) -> tuple[str, ...]:
    """The assumptions, each with its white space made plain."""
    remedy = "assumptions are a list of plain texts"
    if not isinstance(assumptions, list | tuple):
        raise ParameterError(key="assumptions", value=assumptions, remedy=remedy)
    texts = tuple(" ".join(text.split()) if isinstance(text, str) else text for text in assumptions)
    for text in texts:
        if not isinstance(text, str) or not text.isprintable():
            raise ParameterError(key="assumptions", value=text, remedy=remedy)
    return texts
