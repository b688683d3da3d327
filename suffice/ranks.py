"""The processes that torchrun has started for one command."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pod import Ranks

PATIENCE = timedelta(minutes=30)  # with a rank that computes longer than others


def is_first() -> bool:
    """Tell whether this process speaks for all of them."""
    return os.environ.get("RANK", "0") == "0"


@contextmanager
def shared_rows() -> Iterator["Ranks"]:
    """Yield the ranks among which rows are shared: those of torchrun, over NCCL where each has a GPU, else over gloo.

    NCCL refuses two processes on one GPU; gloo lets them share it. Started in any other way, this process has all rows.
    """
    from pod import ALONE, TorchRanks

    if int(os.environ.get("WORLD_SIZE", "1")) < 2:
        yield ALONE
        return
    import torch
    import torch.distributed as dist

    gpus = torch.cuda.device_count()
    if gpus:
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")) % gpus)
    each_has_one = gpus >= max(1, int(os.environ.get("LOCAL_WORLD_SIZE", "1")))
    dist.init_process_group("nccl" if each_has_one else "gloo", timeout=PATIENCE)
    try:
        yield TorchRanks()
    finally:
        dist.destroy_process_group()
