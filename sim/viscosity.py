"""Friction within the fluid: ∇·(ετ), τ = μ (∇u + ∇uᵀ − ⅔ ∇·u)."""

from sim.grid import MARGIN, Frame
from sim.kernel import Array, Indices, inlined, kernel


@inlined
def normal_stress(velocity: Array, weight: Array, frame: Frame, a: int, n: int) -> float:
    """ε τ_aa / μ at the centre of cell n: 2 ε (∂u_a/∂a − ⅓ ∇·u), 1/s."""
    s, h = frame.stride, frame.inverse
    stretch = (velocity[a, n + s[a]] - velocity[a, n]) * h[a]
    total = 0.0
    for b in range(3):
        total += (velocity[b, n + s[b]] - velocity[b, n]) * h[b]
    stress: float = 2.0 * weight[n] * (stretch - total / 3.0)
    return stress


@inlined
def shear_stress(velocity: Array, weight: Array, frame: Frame, a: int, b: int, n: int) -> float:
    """ε τ_ab / μ at the edge of cell n that is its lower one along a and b, 1/s."""
    sa, sb = frame.stride[a], frame.stride[b]
    here = 0.25 * (weight[n] + weight[n - sa] + weight[n - sb] + weight[n - sa - sb])
    along_b = (velocity[a, n] - velocity[a, n - sb]) * frame.inverse[b]
    along_a = (velocity[b, n] - velocity[b, n - sa]) * frame.inverse[a]
    stress: float = here * (along_a + along_b)
    return stress


@inlined
def friction(velocity: Array, weight: Array, frame: Frame, a: int, n: int) -> float:
    """[∇·(ετ)]_a / μ on face n of component a, 1/(m s)."""
    s = frame.stride
    total: float = (
        normal_stress(velocity, weight, frame, a, n) - normal_stress(velocity, weight, frame, a, n - s[a])
    ) * frame.inverse[a]
    for b in range(3):
        if b != a:
            above = shear_stress(velocity, weight, frame, a, b, n + s[b])
            below = shear_stress(velocity, weight, frame, a, b, n)
            total += (above - below) * frame.inverse[b]
    return total


@kernel
def fill_friction(velocity: Array, weight: Array, viscosity: float, frame: Frame, first: Indices, force: Array) -> None:
    """Fill `force` (3, size) with ∇·(ετ) on the faces inside, N/m³; `weight` is ε in the cells, margins filled."""
    s = frame.stride
    for a in range(3):
        for k in range(first[a, 2], frame.cells[2]):
            for j in range(first[a, 1], frame.cells[1]):
                for i in range(first[a, 0], frame.cells[0]):
                    n = (k + MARGIN) * s[2] + (j + MARGIN) * s[1] + (i + MARGIN)
                    force[a, n] = viscosity * friction(velocity, weight, frame, a, n)
