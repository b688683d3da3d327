"""The sweep of nine Δτ as one would do it with flowTorch; `sweep.py` runs it by a Python that has flowTorch.

    PYTHON benchmarks/sweep_flowtorch.py SNAPSHOTS.npy ANSWER.npz THREADS

- own sweep: `pod_subspace_data_dependency`, which compares the modes of each stride with those of all snapshots;
- R_c: `SVD` of the centred training snapshots (its own choice of route, the inner products of the snapshots), all
  testing snapshots projected by one product, and the errors of every n as ‖r‖² + Σ_{i>n} c_i². The residual of all
  modes is formed by blocks of rows that stay in the cache.
"""

import json
import logging
import sys
import time

import numpy as np
import torch

STRIDES = range(10, 1, -1)
HEIGHT = 2048  # rows of a residual at once


def ratio_of(W, stride, SVD):
    """R_c(n) and singular values of one Δτ."""
    training = slice(0, None, stride)
    last = (W.shape[1] - 1) // stride * stride + 1
    mean = W[:, training].mean(dim=1, keepdim=True)
    D = W[:, :last] - mean
    svd = SVD(
        D[:, training].contiguous(), rank=len(range(0, last, stride)) - 1
    )  # about their mean they span one direction less
    c = svd.U.T @ D
    outside = torch.zeros(last, dtype=W.dtype)
    for start in range(0, len(W), HEIGHT):
        rows = slice(start, start + HEIGHT)
        left = torch.addmm(D[rows], svd.U[rows], c, alpha=-1.0)
        outside += left.square().sum(dim=0)
    tail = torch.zeros(len(c) + 1, last, dtype=W.dtype)
    tail[:-1] = c.square().flip(0).cumsum(dim=0).flip(0)
    error = ((tail + outside) / len(W)).sqrt()
    return (error.mean(dim=1) / error[:, training].mean(dim=1)).numpy(), svd.s.numpy()


def timed(work):
    """Return result and seconds, the least of two."""
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return result, min(seconds)


def main():
    logging.disable(logging.INFO)
    from flowtorch.analysis.svd import SVD, pod_subspace_data_dependency

    logging.getLogger().setLevel(logging.WARNING)
    torch.set_num_threads(int(sys.argv[3]))
    W = torch.from_numpy(np.load(sys.argv[1]))
    ratio_of(W[:2000], 10, SVD)  # libraries start their threads
    found, seconds = timed(lambda: [ratio_of(W, stride, SVD) for stride in STRIDES])
    _, own = timed(lambda: pod_subspace_data_dependency(W, None, [1.0], list(STRIDES)))
    arrays = {
        f"{name}_{k}": a for k, pair in zip(STRIDES, found, strict=True) for name, a in zip("rs", pair, strict=True)
    }
    np.savez(sys.argv[2], **arrays)
    print(json.dumps({"R_c": seconds, "own sweep": own}))


if __name__ == "__main__":
    main()
