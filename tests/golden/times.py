"""What a change costs: the CPU time of each command of commands.txt at a revision and now, and their ratio.

    python -m tests.golden.times REVISION [REPEATS] [WORDS]   # of the commands that begin with WORDS

Both trees answer in turn, each in a process of its own that has compiled what it needs and empties the caches of arms
before each command, so that none is answered from one.  What tfarm keeps of its own tables and classes stays.
"""

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def serve():
    """Answer each line on standard input by the CPU seconds of that command, or by what went wrong."""
    from tests import caches
    from tests.golden.answers import answer_of

    for line in sys.stdin:
        try:
            answer_of(line.strip())  # compiles, reads what is on disk
            caches.empty(caches.of_arms().values())
            begin = time.process_time()
            answer_of(line.strip())
            print(json.dumps(time.process_time() - begin), flush=True)
        except Exception as error:  # of a revision that lacks the command
            print(json.dumps(str(error)), flush=True)


@contextlib.contextmanager
def tree_of(revision):
    """A checkout of the revision, for as long as it is used."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", str(path), revision], cwd=ROOT, check=True)
        try:
            yield path
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(path)], cwd=ROOT, check=True)


class Server:
    """A process that times commands with the package of one tree, and the commands and files of this one."""

    def __init__(self, tree):
        code = f"import sys; sys.path.insert(0, {str(tree)!r}); import tfarm; sys.path[0] = {str(ROOT)!r}"
        code += "; from tests.golden.times import serve; serve()"
        environment = {**os.environ, "PYTHONSAFEPATH": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
        )

    def seconds(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


def main(revision, repeats="3", *words):
    ratios = []
    with tree_of(revision) as tree:
        servers = Server(tree), Server(ROOT)
        print(f"{revision + ' [ms]':>12}{'now [ms]':>12}{'ratio':>8}  command")
        for line in (each for each in commands() if each.startswith(" ".join(words))):
            found = [[server.seconds(line) for server in servers] for _ in range(int(repeats))]
            wrong = next((each for pair in found for each in pair if isinstance(each, str)), None)
            if wrong is not None:
                print(f"{'-':>12}{'-':>12}{'-':>8}  {line}: {wrong}")
                continue
            before, now = (statistics.median(column) for column in zip(*found, strict=True))
            ratios.append(now / before)
            print(f"{1e3 * before:12.1f}{1e3 * now:12.1f}{ratios[-1]:8.2f}  {line}", flush=True)
    print(f"geometric mean of {len(ratios)}: {statistics.geometric_mean(ratios):.2f}, largest {max(ratios):.2f}")


if __name__ == "__main__":
    from tests.golden.answers import commands

    main(*sys.argv[1:])
