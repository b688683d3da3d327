"""The modes of a set of snapshots, by Lanczos POD.

Reading order: `snapshots` (the matrix W, read by blocks of rows), `gram` (its inner products), `lanczos` (eigenpairs
from products), `orthonormal` (modes to rounding), `basis` (`lanczos_pod` and what it returns).
"""

from pod.basis import Basis, lanczos_pod
from pod.errors import InputError
from pod.lanczos import RitzPairs, lanczos
from pod.snapshots import RowSource, SnapshotMatrix

__all__ = ["Basis", "InputError", "RitzPairs", "RowSource", "SnapshotMatrix", "lanczos", "lanczos_pod"]
