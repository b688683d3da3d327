"""Contact of two bodies: linear spring, dashpot and Coulomb slider.

The force of paper eq. (4) is evaluated with the velocities that the particles will have at its moment: the half-step
velocity plus half a step of the last acceleration. A dashpot jumps from zero to η v at the two ends of a contact; there
its force is weighted by the part of the step that was spent in contact. Both keep velocity Verlet second order, so that
a pair set to restitution e rebounds with e, and neither acts on particles at rest.
"""

from math import sqrt

from sim.friction import cross, rolling_moment, slip_of, tangential_force
from sim.kernel import Array, Flags, Vector, inlined
from sim.law import ContactLaw

APART, TOUCHING, LEAVING = range(3)  # phase of a contact at the last moment


@inlined
def normal_contact(
    overlap: float, separation_speed: float, phase: float, reduced_mass: float, law: ContactLaw, dt: float
) -> tuple[float, float, float, float, float]:
    """Return the normal force of a contact at this moment, F_n = k δ − w η v_n, its ends resolved within the step.

    A force stands for half a step before and half a step after its moment. But a new contact began overlap / approach
    speed ago, a time that no earlier force covered; and one that will have separated before the next moment ends
    overlap / separation speed from now. Returns the force (N), the energy its dashpot takes (J), the share w of a step
    that it stands for, the time in contact since the last moment (s), and the phase for the next.
    """
    begins = phase == APART
    first = min(-overlap / (separation_speed * dt), 1.0) if begins and separation_speed < 0.0 else 0.5
    elapsed = first * dt if begins else dt
    before = 0.0 if phase == LEAVING else first  # the last force stood for that time too
    damping = law.damping * sqrt(reduced_mass) * separation_speed
    elastic = law.stiffness * overlap
    load = max(elastic - (before + 0.5) * damping, law.least_load)
    ahead = (separation_speed + 0.5 * dt * load / reduced_mass) * dt
    leaves = ahead > overlap
    share = before + (overlap / ahead if leaves else 0.5)
    load = max(elastic - share * damping, law.least_load)
    return load, (elastic - load) * separation_speed * dt, share, elapsed, LEAVING if leaves else TOUCHING


@inlined
def contact_force(
    entry: int,
    overlap: float,
    normal: Vector,
    approach: Vector,
    spin: Vector,
    turn: Vector,
    arm: float,
    touching: Flags,
    spring: Array | None,
    rolls: bool | None,
    reduced_mass: float,
    mobility: float,
    law: ContactLaw,
    dt: float,
) -> tuple[Vector, Vector, Vector, float]:
    """Return the force of a contact with a wall (N), its torque, the moment against rolling in it (N m), the loss (J).

    `approach` is the velocity of the centre against the wall's surface (m/s), `spin` that of the particle and `turn`
    that of the wall (rad/s), `arm` the particle's lever (m), `mobility` its 1/I. Phase and springs of the list's entry
    are brought up to date; without springs (None) there is no friction, without `rolls` no moment against rolling.
    """
    nx, ny, nz = normal
    speed = approach[0] * nx + approach[1] * ny + approach[2] * nz
    load, lost, share, elapsed, phase = normal_contact(overlap, speed, touching[entry], reduced_mass, law, dt)
    touching[entry] = phase
    fx, fy, fz = load * nx, load * ny, load * nz
    tx, ty, tz = 0.0, 0.0, 0.0
    couple = (0.0, 0.0, 0.0)
    if spring is not None:
        slip = slip_of(normal, approach, speed, (arm * spin[0], arm * spin[1], arm * spin[2]))
        old = (spring[entry, 0], spring[entry, 1], spring[entry, 2])
        rub, new, rubbed = tangential_force(normal, slip, old, load, share, reduced_mass, law, dt, elapsed)
        spring[entry, 0], spring[entry, 1], spring[entry, 2] = new
        lost += rubbed
        fx, fy, fz = fx + rub[0], fy + rub[1], fz + rub[2]
        mx, my, mz = cross(normal, rub)
        tx, ty, tz = -arm * mx, -arm * my, -arm * mz
        if rolls is not None:
            old = (spring[entry, 3], spring[entry, 4], spring[entry, 5])
            turning = (spin[0] - turn[0], spin[1] - turn[1], spin[2] - turn[2])
            couple, new, rubbed = rolling_moment(normal, turning, old, load, share, arm, mobility, law, dt, elapsed)
            spring[entry, 3], spring[entry, 4], spring[entry, 5] = new
            lost += rubbed
            tx, ty, tz = tx + couple[0], ty + couple[1], tz + couple[2]
    return (fx, fy, fz), (tx, ty, tz), couple, lost


@inlined
def part(entry: int, touching: Flags, spring: Array | None, law: ContactLaw, reduced_radius: float) -> float:
    """End a contact that there may have been, and return the energy (J) that was left in its springs."""
    if touching[entry] == APART:
        return 0.0
    touching[entry] = APART
    left = 0.0
    if spring is not None:
        left = spring_energy(entry, spring, law, reduced_radius)
        for column in range(spring.shape[1]):
            spring[entry, column] = 0.0
    return left


@inlined
def spring_energy(entry: int, spring: Array, law: ContactLaw, reduced_radius: float) -> float:
    """Energy in the springs of a contact, ½ k_t s² + ½ k_r θ², J."""
    energy = 0.0
    for column in range(3):
        energy += 0.5 * law.tangential_stiffness * spring[entry, column] ** 2
    if spring.shape[1] > 3:
        for column in range(3, 6):
            energy += 0.5 * law.rolling_stiffness * (reduced_radius * spring[entry, column]) ** 2
    return energy
