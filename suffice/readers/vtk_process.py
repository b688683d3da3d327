"""VTK's readers in a process of their own, so that a hostile file can stop them but not us."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from suffice.refusal import Refusal

PROGRAM = Path(__file__).with_name("vtk_program.py")
MEMORY_OF_VTK = 1 << 30  # bytes of address space; the program takes a third of it before it reads anything
MEMORY_PER_BYTE = 64  # of a file: compressed text of numbers grows twentyfold
SECONDS_OF_VTK, BYTES_PER_SECOND = 60, 500_000  # it may take; a slow disk gives a hundred times as many
REMEDY = "write it again, or copy it again"


class Piece(NamedTuple):
    """One dataset: particles, cells, or an image of uniform cells."""

    facts: dict[str, Any]
    arrays: dict[str, NDArray[Any]]  # `points`, `point:NAME`, `cell:NAME`, `field:NAME`, `hexahedra`


class VtkProcess:
    """Ask for files one after the other: `with VtkProcess() as vtk: vtk.read(path, "legacy")`.

    Raises `Refusal` where VTK is not installed, or cannot read a file to its end.
    """

    def __init__(self) -> None:
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "VTK_SMP_MAX_THREADS": "1"}
        # -P: no module beside the program stands in for one of Python's
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(PROGRAM)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment,
            start_new_session=True,  # Ctrl-C is for us; the program ends when its pipe is closed
        )  # fmt: skip

    def read(self, path: Path, type: str, wanted: Sequence[str] | None = None) -> Piece:
        """Read one file of a type of `vtk_program.READERS`; `wanted` names the arrays to hand on, None for all."""
        request = {"path": str(path), "type": type, "wanted": None if wanted is None else list(wanted)}
        pieces, _ = self._ask(path, request, path.stat().st_size)
        return pieces[0]

    def times_of_case(self, path: Path, decomposed: bool) -> list[float]:
        """Return the times of an OpenFOAM case, s; `decomposed`: those its processors hold."""
        return self._ask(path, {"path": str(path), "type": "OpenFOAM", "decomposed": decomposed}, 0)[1]

    def read_case(self, path: Path, time: float, size: int, decomposed: bool) -> list[Piece]:
        """Read an OpenFOAM case at one of its times; `size` is that of its files in bytes."""
        request = {"path": str(path), "type": "OpenFOAM", "time": time, "decomposed": decomposed}
        return self._ask(path, request, size)[0]

    def _ask(self, path: Path, request: dict[str, Any], size: int) -> tuple[list[Piece], list[float]]:
        request["memory"] = MEMORY_OF_VTK + MEMORY_PER_BYTE * size
        request["seconds"] = SECONDS_OF_VTK + size // BYTES_PER_SECOND
        ask, reply = self._process.stdin, self._process.stdout
        assert ask is not None
        assert reply is not None
        try:
            ask.write(json.dumps(request).encode() + b"\n")
            ask.flush()
            line = reply.readline()
        except BrokenPipeError:
            line = b""
        if not line:
            raise Refusal(f"{path} stops VTK's reader ({self._end()}): it is damaged; {REMEDY}")
        answer = json.loads(line)
        if "absent" in answer:
            raise Refusal(f"{path}: to read VTK and OpenFOAM files, `pip install vtk`")
        if "broken" in answer:
            raise Refusal(f"{path} cannot be read to its end ({answer['broken']}); {REMEDY}")
        return [self._piece(path, head) for head in answer["pieces"]], answer["times"]

    def _piece(self, path: Path, head: dict[str, Any]) -> Piece:
        arrays: dict[str, NDArray[Any]] = {}
        for name, (kind, shape) in head.pop("arrays").items():
            arrays[name] = np.empty(shape, np.dtype(kind))
            view = memoryview(arrays[name].reshape(-1).view(np.uint8).data)
            while len(view):
                n = self._process.stdout.readinto(view) if self._process.stdout else 0  # type: ignore[attr-defined]
                if not n:
                    raise Refusal(f"{path} stops VTK's reader ({self._end()}): it is damaged; {REMEDY}")
                view = view[n:]
        return Piece(head, arrays)

    def _end(self) -> str:
        code = self._process.wait()
        if code == -signal.SIGALRM:
            return "it takes far longer than a file of this size may"
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def close(self) -> None:
        """End the program."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):
                    pipe.close()
        self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
