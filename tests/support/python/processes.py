"""Starting a program."""

import contextlib
import subprocess


@contextlib.contextmanager
def started(command, stdout=subprocess.PIPE, **options):
    """The process, which is not left behind, whatever happens."""
    process = subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, text=True, **options)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
