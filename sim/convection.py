"""Momentum that the fluid carries along.

Paper eq. (10) holds ∂(ερu)/∂t + ∇·(ερuu); less u times eq. (11) it is ερ ∂u/∂t + ρ [∇·(εuu) − u ∇·(εu)], in which a
uniform flow stays uniform whatever the void fraction does.
"""

from sim.grid import MARGIN, Frame
from sim.kernel import Array, Indices, inlined, kernel


@kernel
def fill_flux(velocity: Array, void_fraction: Array, frame: Frame, flux: Array) -> None:
    """Fill `flux` (3, size) with ε u on all faces that have a cell on both sides, m/s."""
    for a in range(3):
        s = frame.stride[a]
        for n in range(s, flux.shape[1]):
            flux[a, n] = 0.5 * (void_fraction[n - s] + void_fraction[n]) * velocity[a, n]


@inlined
def limited(before: float, here: float, after: float) -> float:
    """Value half a cell downstream of `here`, kept between `here` and `after` (van Leer 1974)."""
    rise, next_rise = here - before, after - here
    product = rise * next_rise
    return here + product / (rise + next_rise) if product > 0.0 else here


@inlined
def carried(flux: float, u: Array, low: int, step: int, bounded: bool) -> float:
    """Velocity that a flux carries from `low` to `low` + `step`: their mean, or limited by what comes from upstream."""
    if not bounded:
        mean: float = 0.5 * (u[low] + u[low + step])
        return mean
    if flux > 0.0:
        return limited(u[low - step], u[low], u[low + step])
    return limited(u[low + 2 * step], u[low + step], u[low])


@kernel
def fill_convection(velocity: Array, flux: Array, frame: Frame, first: Indices, bounded: bool, rate: Array) -> None:
    """Fill `rate` (3, size) with −[∇·(εuu) − u ∇·(εu)] on the faces inside, m/s², margins of `velocity` being filled.

    `first` (3, 3) is where the faces inside of each component begin: second order in space, by the mean of two
    neighbours or, `bounded`, limited so that no new extreme arises.
    """
    s = frame.stride
    for a in range(3):
        u, own = velocity[a], s[a]
        for k in range(first[a, 2], frame.cells[2]):
            for j in range(first[a, 1], frame.cells[1]):
                for i in range(first[a, 0], frame.cells[0]):
                    n = (k + MARGIN) * s[2] + (j + MARGIN) * s[1] + (i + MARGIN)
                    total = 0.0
                    for b in range(3):
                        step = s[b]
                        into = 0.5 * (flux[b, n - own] + flux[b, n])
                        out = 0.5 * (flux[b, n - own + step] + flux[b, n + step])
                        gained = into * (carried(into, u, n - step, step, bounded) - u[n])
                        lost = out * (carried(out, u, n, step, bounded) - u[n])
                        total += (gained - lost) * frame.inverse[b]
                    rate[a, n] = total
