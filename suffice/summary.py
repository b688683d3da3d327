"""What a run tells about itself when it ends: speed, energy, margins of its guards, lists, clamps, warnings."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from suffice import layout
from suffice.refusal import Refusal
from suffice.run import Run

Outcome = Literal["done", "limit", "interrupted"]
MOST = 2**63  # of anything that is counted
Count = Annotated[int, Field(ge=0, le=MOST)]


class Part(BaseModel):
    """A part of a summary; what a newer version adds is passed over."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, strict=True)


class Pace(Part):
    """Speed of a run on the machine that made it, without compiling and loading; flows of a fluid alone have cells."""

    seconds: float
    compiling_seconds: float
    steps_per_second: float
    particle_steps_per_second: float | None = None
    cell_steps_per_second: float | None = None
    simulated_ms_per_minute: float


class Energy(Part):
    """Energy (J) that start, walls, fluid and weight put in, what the ledger misses of it at the end, and at most."""

    put_in: float
    residual: float
    largest_residual: float
    largest_at: float  # s


class Guard(Part):
    """Largest value that a guard has seen, when (s), and its limit; None: none that is finite, of a limit: lifted."""

    largest: float | None
    at: float
    limit: float | None
    unit: str

    @property
    def share(self) -> float | None:
        """The largest value over its limit."""
        return None if self.largest is None or not self.limit else self.largest / self.limit


class Lists(Part):
    """How often the neighbours were listed anew, and after how many steps in the mean, None where never."""

    rebuilds: Count
    mean_steps: float | None


class Clamp(Part):
    """How many values were held at a bound, of how many that were looked at."""

    count: Count
    of: Count
    bound: float


class Warnings(Part):
    """Warnings of one kind: how many, and the words of the first."""

    count: Count
    first: str


class Summary(Part):
    """Everything that a run tells; a term that the scene lacks is None or empty."""

    outcome: Outcome
    time: float  # s, simulated
    steps: Count
    fluid_steps: Count | None = None
    energy: Energy | None = None
    guards: dict[str, Guard]
    neighbours: Lists | None = None
    clamps: dict[str, Clamp]
    warnings: dict[str, Warnings]
    pace: Pace | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return it in plain types, with the share of its limit that every guard reached."""
        found = self.model_dump()
        for name, guard in self.guards.items():
            found["guards"][name]["share"] = guard.share
        return found


def read_summary(run: Run) -> Summary | None:
    """Return what a run told when it ended or was stopped, None where it did not. Raises Refusal for a damaged one."""
    text = run.text(layout.SUMMARY)
    if not text:
        return None
    try:
        found = Summary.model_validate_json(text)
        pace = run.text(layout.PACE)
        return found.model_copy(update={"pace": Pace.model_validate_json(pace) if pace else None})
    except ValidationError as error:
        raise Refusal(
            f"{run.path} is damaged: its summary is none ({error.errors()[0]['msg']}); make it again"
        ) from None
