"""Start of the kernels that execute notebooks of the documentation; `conf.py` copies it into their IPython profile."""

import subprocess
import sys

from IPython.core.magic import register_cell_magic


@register_cell_magic
def bash(line: str, cell: str) -> None:
    """Run commands as IPython's own `%%bash`, whose output comes in pieces that MyST-NB puts on lines of their own."""
    done = subprocess.run(["bash", "-e", "-c", cell], capture_output=True, text=True, check=False)
    print(done.stdout, end="")
    if done.returncode:
        print(done.stderr, end="", file=sys.stderr)
        raise SystemExit(done.returncode)
