"""The tests marked `survey`, which `make test` leaves out: one of many alike, or dear.  python -m tests.left_out"""

import subprocess
import sys

if __name__ == "__main__":
    sys.exit(subprocess.run([sys.executable, "-m", "pytest", "-q", "-n", "2", "-m", "survey"], check=False).returncode)
