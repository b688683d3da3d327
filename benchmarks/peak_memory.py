"""Peak of the resident memory of this process above what it holds now."""

import ctypes
import re
from pathlib import Path


class PeakMemory:
    """`peak = PeakMemory()`, work, then `peak.extra()` bytes; the kernel keeps the peak, so that nothing is missed."""

    def __init__(self) -> None:
        ctypes.CDLL("libc.so.6").malloc_trim(0)  # what was freed and kept would be used again, uncounted
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts again from here
        self._level = _status("VmRSS")

    def extra(self) -> int:
        """Bytes that the peak since the start lies above the level of the start."""
        return max(_status("VmHWM") - self._level, 0)


def _status(field: str) -> int:
    return 1024 * int(re.search(rf"{field}:\s+(\d+)", Path("/proc/self/status").read_text())[1])
