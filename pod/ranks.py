"""The processes that share one snapshot matrix by its rows, each with its own."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import TypeVar

import numpy as np
import torch
import torch.distributed as dist
from numpy.typing import NDArray
from torch import Tensor

from pod.errors import InputError, LostRankError

Array = NDArray[np.float64]
T = TypeVar("T")


class Ranks:
    """One process that holds all rows; the base of several that share them."""

    rank, size = 0, 1

    def share(self, rows: int, together: int) -> slice:
        """Rows of this process, so cut that rows which belong to one particle stay together."""
        particles = rows // together
        cuts = [particles * k // self.size * together for k in (self.rank, self.rank + 1)]
        return slice(cuts[0], rows if self.rank == self.size - 1 else cuts[1])

    def summed(self, values: Array) -> Array:
        """Sum of the values of all processes, the same to the last bit on each."""
        return values

    def largest(self, values: Array) -> Array:
        """Largest of the values of all processes, entry by entry."""
        return values

    def agreed(self, work: Callable[[], T]) -> T:
        """Do a piece of work; where any process refuses its rows (InputError), all of them do."""
        return work()

    def pieces(self, rows: Array) -> Iterator[Array]:
        """Rows of all processes in order, on the first of them; the others, which must ask as well, get nothing."""
        yield rows


ALONE = Ranks()


class TorchRanks(Ranks):
    """Processes that `torchrun` has started, over torch.distributed: NCCL where the device is a GPU, else gloo.

    Raises LostRankError where another process has ended.
    """

    def __init__(self) -> None:
        self.rank, self.size = dist.get_rank(), dist.get_world_size()
        self._device = torch.device("cuda") if dist.get_backend() == "nccl" else torch.device("cpu")

    def summed(self, values: Array) -> Array:
        """Sum by all_reduce; then all take the first one's, so that what they decide from it is the same."""
        return self._reduced(values, dist.ReduceOp.SUM)

    def largest(self, values: Array) -> Array:
        """Largest by all_reduce."""
        return self._reduced(values, dist.ReduceOp.MAX)

    def agreed(self, work: Callable[[], T]) -> T:
        """Do the work, and tell all other processes whether it could be done."""
        try:
            result, refusal = work(), ""
        except InputError as error:
            refusal = str(error)
        said: list[str] = [""] * self.size
        self._alive(lambda: dist.all_gather_object(said, refusal))
        for words in said:
            if words:
                raise InputError(words)
        return result

    def pieces(self, rows: Array) -> Iterator[Array]:
        """Send to the first process, one after another."""
        shapes: list[tuple[int, ...]] = [()] * self.size
        self._alive(lambda: dist.all_gather_object(shapes, rows.shape))
        if self.rank > 0:
            sent = torch.from_numpy(np.ascontiguousarray(rows)).to(self._device)
            self._alive(lambda: dist.send(sent, 0))
            return
        yield rows
        for other in range(1, self.size):
            received = torch.empty(shapes[other], dtype=torch.float64, device=self._device)
            self._alive(partial(dist.recv, received, other))
            yield received.cpu().numpy()

    def _reduced(self, values: Array, operation: "dist.ReduceOp.RedOpType") -> Array:
        total: Tensor = torch.from_numpy(np.array(values, dtype=np.float64)).to(self._device)
        self._alive(lambda: dist.all_reduce(total, operation))
        self._alive(lambda: dist.broadcast(total, 0))
        return np.asarray(total.cpu().numpy())

    def _alive(self, exchange: Callable[[], object]) -> None:
        try:
            exchange()
        except RuntimeError as error:  # what torch.distributed raises when a connection is gone
            words = str(error).splitlines()[0][:200]
            raise LostRankError(f"rank {self.rank} of {self.size}: another rank has ended ({words})") from None
