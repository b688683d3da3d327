"""The physical time of each snapshot, from what the source says and what the user says."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.refusal import Refusal

AGREEMENT = 1e-3  # of an interval: times written with six digits differ by half of it, wrong time steps by far more


class Stamps(NamedTuple):
    """What a source says of the time of its n snapshots; None where it does not say it."""

    n: int
    steps: NDArray[np.int64] | None = None  # (n,) time step numbers
    times: NDArray[np.float64] | None = None  # (n,) s
    origin: str = "the source"  # where the times stand


class Clock(NamedTuple):
    """Times of the snapshots, (snapshots,) in s, and where they come from."""

    times: NDArray[np.float64]
    origin: str


def physical_times(stamps: Stamps, interval: float | None = None, timestep: float | None = None) -> Clock:
    """Return the time of every snapshot: as the source says it, or step × `timestep`, or 0, 1, 2 … × `interval` (s).

    Where several are known they must agree on the time since the first snapshot. Raises `Refusal` when none is known,
    when two contradict each other, or when time does not increase.
    """
    steps, said = stamps.steps, stamps.times
    _check_positive("--interval", interval)
    _check_positive("--timestep", timestep)
    known: list[Clock] = []
    if steps is not None:
        _check_increasing("time step", steps, "")
    if said is not None:
        _check_increasing("time", said, " s")
        known.append(Clock(said, stamps.origin))
    if timestep is not None:
        if steps is None:
            raise Refusal(
                f"--timestep {timestep:g} s: the source does not number its time steps; give the time between two "
                "snapshots with --interval SECONDS"
            )
        known.append(Clock(steps * np.float64(timestep), f"time steps of the source times --timestep {timestep:g} s"))
    if interval is not None:
        if steps is not None:
            _check_even(steps, interval)
        known.append(Clock(np.arange(stamps.n) * np.float64(interval), f"--interval {interval:g} s"))
    if not known:
        raise Refusal(
            "the source does not say its physical times; give the solver's time step with --timestep SECONDS, "
            "or the time between two snapshots with --interval SECONDS"
        )
    for other in known[1:]:
        _check_agreement(known[0], other)
    return known[0]


def _check_positive(option: str, value: float | None) -> None:
    if value is not None and not (np.isfinite(value) and value > 0):
        raise Refusal(f"{option} is {value:g} s; it must be a positive number of seconds")


def _check_increasing(what: str, values: NDArray[np.int64] | NDArray[np.float64], unit: str) -> None:
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        raise Refusal(f"{what} of snapshot {k} is {values[k]}{unit}, not a finite number; correct it")
    if (back := np.flatnonzero(np.diff(values) <= 0)).size:
        k = int(back[0])
        raise Refusal(
            f"{what} {values[k + 1]}{unit} of snapshot {k + 1} does not come after {values[k]}{unit} of snapshot {k}; "
            "leave out repeated snapshots, or import the parts of a restarted run one by one"
        )


def _check_even(steps: NDArray[np.int64], interval: float) -> None:
    gaps = np.diff(steps)
    if (odd := np.flatnonzero(gaps != gaps[:1])).size:
        k = int(odd[0])
        raise Refusal(
            f"--interval {interval:g} s does not fit: time steps {steps[k]} and {steps[k + 1]} are {gaps[k]} apart, "
            f"the first two {gaps[0]}; give --timestep SECONDS instead, or the snapshots that are missing"
        )


def _check_agreement(one: Clock, other: Clock) -> None:
    if len(one.times) < 2:
        return
    since, since_other = (clock.times - clock.times[0] for clock in (one, other))
    mean_interval = since[-1] / (len(since) - 1)
    worst = int(np.argmax(np.abs(since - since_other)))
    if abs(since[worst] - since_other[worst]) > AGREEMENT * mean_interval:
        raise Refusal(
            f"the times contradict each other: snapshot {worst} is {since[worst]:g} s after the first by {one.origin}, "
            f"{since_other[worst]:g} s by {other.origin}; correct or leave out the latter"
        )
