"""Leave-one-out error of radial interpolation, in closed form."""

import numpy as np
from numpy.typing import NDArray

from surrogates.kernel import Kernel, kernel_matrix


def leave_one_out(kernel: Kernel, times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Error (snapshots, modes) at each snapshot of the interpolant that was not shown it, without refitting.

    e_i = (M⁻¹ c)_i / (M⁻¹)_ii with M the saddle matrix (Rippa 1999, doi 10.1023/A:1018975909870; the polynomial part
    changes nothing in the argument). `times` (snapshots,) in Δτ, `values` (snapshots, modes).
    Infinite where the matrix is singular.
    """
    n = len(times)
    try:
        inverse = np.linalg.inv(kernel_matrix(kernel, times))[:n, :n]
    except np.linalg.LinAlgError:
        return np.full(values.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = (inverse @ values) / inverse.diagonal()[:, None]
    return np.where(np.isfinite(errors), errors, np.inf)
