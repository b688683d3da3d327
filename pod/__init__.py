"""The modes of a set of snapshots, by Lanczos POD.

Reading order: `snapshots` (the matrix W, read by tiles of rows; `given` looks at what it is made of), `gram` (its inner
products), `lanczos` (eigenpairs from products), `orthonormal` (modes to rounding), `routes` and `truncation` (which
product, how many modes), `basis` (`lanczos_pod` and what it returns), `convergence`, `growing` (more snapshots),
`enriched` (positions and velocities), `ranks` (rows shared by processes).
"""

from pod.basis import Basis, lanczos_pod
from pod.convergence import Convergence, lanczos_convergence
from pod.enriched import Enriched, enriched_pod
from pod.errors import InputError, LostRankError
from pod.growing import grown_gram
from pod.lanczos import RitzPairs, lanczos
from pod.ranks import ALONE, Ranks, TorchRanks
from pod.snapshots import RowSource, SnapshotMatrix

__all__ = [
    "ALONE",
    "Basis",
    "Convergence",
    "Enriched",
    "InputError",
    "LostRankError",
    "Ranks",
    "RitzPairs",
    "RowSource",
    "SnapshotMatrix",
    "TorchRanks",
    "enriched_pod",
    "grown_gram",
    "lanczos",
    "lanczos_convergence",
    "lanczos_pod",
]
