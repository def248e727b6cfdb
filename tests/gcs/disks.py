"""Disks that take no more: by a limit that the system puts on this process, and as a file system of a few megabytes."""

import json
import resource
import signal
import subprocess
import sys


class Limited:
    """No file may grow beyond so many bytes, as if the disk were full: a write may stop half way."""

    def __init__(self, size):
        self._size = size

    def __enter__(self):
        self._before = resource.getrlimit(resource.RLIMIT_FSIZE)
        self._handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (self._size, self._before[1]))

    def __exit__(self, *_error):
        resource.setrlimit(resource.RLIMIT_FSIZE, self._before)
        signal.signal(signal.SIGXFSZ, self._handler)


NAMESPACES = (["unshare", "--mount"], ["unshare", "--mount", "--user", "--map-root-user"])
"""Where a file system may be mounted that nobody else sees: by root, and by anybody."""
MOUNT = 'mount -t tmpfs -o size="$0" tmpfs "$1" && shift && exec "$@"'


def on_a_small_disk(size, folder, script, *words):
    """What a Python script says on stdout, as JSON, while a file system of so many bytes is mounted on the folder."""
    command = ["sh", "-c", MOUNT, str(size), folder, sys.executable, script, *words]
    refusals = []
    for namespace in NAMESPACES:
        if subprocess.run([*namespace, "sh", "-c", MOUNT, str(size), folder, "true"], capture_output=True).returncode:
            refusals.append(" ".join(namespace))
            continue
        ended = subprocess.run([*namespace, *map(str, command)], capture_output=True, text=True, check=False)
        assert ended.returncode == 0, ended.stderr
        return json.loads(ended.stdout)
    raise AssertionError(f"this test mounts a small file system, which neither {' nor '.join(refusals)} may do here")
