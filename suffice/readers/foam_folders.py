"""Where a case of OpenFOAM keeps its times: in its own folder, or in those of the processors it ran on."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from suffice.refusal import Refusal

SAME_TIME = 1e-9  # s, and relative: a folder's name is the time in a few digits
CONTROL = Path("system") / "controlDict"


class FoamFolders(NamedTuple):
    """The folder of a case, and those that hold its times."""

    case: Path
    holders: Sequence[Path]  # the case itself, or its processors

    @property
    def decomposed(self) -> bool:
        """Whether the times stand in the folders of processors."""
        return self.holders[0] != self.case

    @property
    def control(self) -> Path:
        """The file by which VTK knows the case."""
        return self.case / CONTROL

    def size_of(self, time: float) -> int:
        """Return the bytes of the files that hold the mesh and one time. Raises `Refusal` for a device or a pipe."""
        folders = [holder / "constant" / "polyMesh" for holder in self.holders]
        folders += self._at(time)
        files = [file for folder in folders for file in folder.rglob("*") if not file.is_dir()]
        if odd := next((file for file in files if not file.is_file()), None):
            raise Refusal(f"{odd} is no file, and may have no end; put a file there, or remove it")
        return sum(file.stat().st_size for file in files)

    def clouds_at(self, time: float) -> set[str]:
        """Return the names of the clouds that have files at a time."""
        return {file.parent.name for folder in self._at(time) for file in folder.glob("lagrangian/*/*")}

    def _at(self, time: float) -> list[Path]:
        return [path for holder in self.holders for each, path in _times_in(holder) if _same(each, time)]


def find_folders(sources: Sequence[Path]) -> FoamFolders:
    """Return the folders of a case: its processors' where they hold more times than the reconstructed case.

    Raises `Refusal` where there is no case, the processors do not hold the same times, or share files that VTK cannot
    read.
    """
    if len(sources) > 1:
        raise Refusal(f"{len(sources)} sources are named; give one case of OpenFOAM at a time")
    case = sources[0] if sources[0].is_dir() else sources[0].parent
    if not (case / CONTROL).is_file():
        raise Refusal(f"case {case} has no {CONTROL}; name the folder of a case")
    own = len(_times_in(case))
    for shared in case.glob("processors*"):
        if len(_times_in(shared)) > own:
            raise Refusal(f"case {case}: VTK cannot read {shared.name}, files in collated form; run reconstructPar")
    processors = sorted(case.glob("processor[0-9]*"), key=lambda path: (len(path.name), path.name))
    if not processors or len(_times_in(processors[0])) <= own:
        return FoamFolders(case, [case])
    first = {name.name for _, name in _times_in(processors[0])}
    for processor in processors[1:]:
        if odd := first ^ {name.name for _, name in _times_in(processor)}:
            raise Refusal(
                f"case {case}: {processors[0].name} and {processor.name} do not hold the same times, {min(odd)} s is "
                "in one of them alone; remove it, or run reconstructPar"
            )
    return FoamFolders(case, processors)


def _times_in(folder: Path) -> list[tuple[float, Path]]:
    """Return the times a folder holds, and their folders."""
    found = []
    for path in folder.iterdir():
        try:
            found.append((float(path.name), path))
        except ValueError:
            continue
    return [(time, path) for time, path in found if path.is_dir()]


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= SAME_TIME * max(abs(other), 1.0)
