"""Simulates the drive that the tests of the programs run on: eight seconds of a street."""

import shutil
import subprocess
import sys

from programs import DRIVE, command

if __name__ == "__main__":
    shutil.rmtree(DRIVE, ignore_errors=True)
    sys.exit(subprocess.run(command("roadvec-simulate", "street", DRIVE, "--duration", 8), check=False).returncode)
