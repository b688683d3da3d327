"""The datasets of an HDF5 file by their paths, also where every snapshot has a group of its own."""

import re
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from suffice import layout
from suffice.hdf5_memory import names_in
from suffice.readers.hdf5 import node_of, opened
from suffice.refusal import Refusal

ANY, ATTRIBUTE = "*", "@"  # /step_*/position: one for each snapshot; /step_*@time: an attribute of each


class Datasets:
    """The datasets of one HDF5 file; the file is open only while something is read.

    A path with `*` stands for one dataset of each snapshot, in the order of the numbers in their names, and
    `PATH@NAME` for an attribute. Raises `Refusal` where there is none, or they differ in shape.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with opened(path) as file:
            if node_of(file, layout.PLAN) is not None:
                raise Refusal(f"{path} is a run already; name it where a run is asked for")
            self.names = names_in(file)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a dataset, stacked along a first axis where each snapshot has its own."""
        with opened(self.path) as file:
            if ANY not in name:
                return tuple(int(n) for n in self._node(file, name).shape)
            paths = self._paths(file, name)
            shapes = [tuple(int(n) for n in self._node(file, path).shape) for path in paths]
        for path, shape in zip(paths, shapes, strict=True):
            if shape != shapes[0]:
                raise Refusal(
                    f"{self.path}: {path} has shape {shape}, {paths[0]} has {shapes[0]}; every snapshot must hold the "
                    "same particles: write those that do into a file of their own"
                )
        return (len(paths), *(shapes[0] if shapes[0] != (1,) else ()))

    def whole(self, name: str) -> NDArray[Any]:
        """Return a dataset, stacked where each snapshot has its own."""
        with opened(self.path) as file:
            if ANY not in name:
                return np.asarray(self._node(file, name)[()])
        return np.stack(list(self.rows(name))).reshape(self.shape(name))

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield a dataset along its first axis, or that of each snapshot, holding one part in memory."""
        with opened(self.path) as file:
            if ANY in name:
                for path in self._paths(file, name):
                    yield np.asarray(self._node(file, path)[()])
                return
            node = self._node(file, name)
            for k in range(node.shape[0]):
                yield np.asarray(node[k])

    def _node(self, file: Any, name: str) -> Any:
        path, of, attribute = name.partition(ATTRIBUTE)
        node = node_of(file, path)
        if of and node is not None:
            return self._attribute(node, name, attribute)
        if node is None or not hasattr(node, "shape"):
            raise Refusal(
                f"{self.path} has no dataset {name}; it has {', '.join(self.names[:12])}: say which with --map"
            )
        return node

    def _attribute(self, node: Any, name: str, attribute: str) -> NDArray[Any]:
        held = node.attrs.get_id(attribute) if attribute in node.attrs else None
        if held is None or held.dtype.kind not in "fiu" or held.shape not in ((), (1,)):
            raise Refusal(f"{self.path} has no number {name}; say with --map which attribute is meant")
        return np.asarray(node.attrs[attribute])

    def check_together(self, names: Iterable[str]) -> None:
        """Refuse names with `*` where it does not stand for the same in each, snapshot by snapshot."""
        with opened(self.path) as file:
            stands = {name: [stars for _, stars in self._found(file, name)] for name in names if ANY in name}
        first = next(iter(stands), "")
        for name, own in stands.items():
            if odd := set(own) ^ set(stands[first]):
                raise Refusal(
                    f"{self.path}: {'/'.join(min(odd))} is in one of {first} and {name} alone; every snapshot must "
                    "hold what the others hold"
                )

    def _paths(self, file: Any, pattern: str) -> list[str]:
        return [path for path, _ in self._found(file, pattern)]

    def _found(self, file: Any, pattern: str) -> list[tuple[str, tuple[str, ...]]]:
        """Return the paths that a pattern means and what its `*` is in each, in the order of the numbers in them."""
        path, of, attribute = pattern.partition(ATTRIBUTE)
        found: list[tuple[str, tuple[str, ...]]] = [("", ())]
        for part in (part for part in path.split("/") if part):
            found = [
                (f"{above}/{name}", (*stars, name) if ANY in part else stars)
                for above, stars in found
                for name in self._children(file, above, part)
            ]
        if not found:
            raise Refusal(f"{self.path} has nothing at {pattern}; it has {', '.join(self.names[:12])}")
        found.sort(key=lambda each: _numbers(each[0]))
        return [(f"{path}{of}{attribute}", stars) for path, stars in found]

    def _children(self, file: Any, above: str, part: str) -> list[str]:
        """Return the names in a group that a part of a pattern means; none where there is a dataset, not a group."""
        node = node_of(file, above)
        if not isinstance(node, h5py.Group):
            return []
        if ANY in part:
            return [name for name in names_in(node) if fnmatchcase(name, part)]
        if part not in names_in(node):
            raise Refusal(f"{self.path}: {above} has no {part}; name the groups of the snapshots alone, as in /step_*/")
        return [part]


def _numbers(path: str) -> list[tuple[str, float]]:
    """Return what sorts step_9 before step_10, and 0.05 before 0.1."""
    return [(text, float(number or 0)) for text, number in re.findall(r"(\D*)(\d*(?:\.\d+)?(?:[eE][-+]?\d+)?)", path)]
