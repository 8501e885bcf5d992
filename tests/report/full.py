"""A full report on one arm, one a session: by a process with other hashes and in another time zone.

Its name and assumptions are as hostile as they may be; its audit is the one that the command of this session has made.
"""

import os
import subprocess
import sys
from dataclasses import replace

import tfarm
from tests.hostile import LONG, NAME, PRINTED
from tfarm.arm import to_toml

ASSUMPTIONS = (PRINTED, "second assumption", LONG)
ARM = replace(tfarm.load("stocky-steel"), name=NAME, assumptions=ASSUMPTIONS)
REPORT = (
    "import pickle, sys, tfarm; from pathlib import Path; from tfarm import audit; from tfarm.report import write;"
    "rows = pickle.loads(Path(sys.argv[3]).read_bytes()); audit.audit = lambda: rows;"
    "from tests.report.coarse import coarsen; coarsen();"  # the map and the sampled section have tests of their own
    "print(write([tfarm.load(sys.argv[1])], Path(sys.argv[2])));"
    "pyplot = sys.modules.get('matplotlib.pyplot');"  # python-control imports it; no figure may be its own
    "print(bool(pyplot and pyplot.get_fignums()))"
)


def report_elsewhere(audit_file, out):
    file = out.with_suffix(".toml")
    file.write_text(to_toml(ARM), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", REPORT, str(file), str(out), str(audit_file)],
        env={**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.splitlines(), done.stderr) == ([str(out / "index.html"), "False"], "")
