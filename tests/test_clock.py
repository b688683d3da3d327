import numpy as np
import pytest

from suffice.readers.clock import Stamps, physical_times
from suffice.refusal import Refusal

STEPS = (0, 100, 200, 300)


def test_a_restarted_count_of_steps_keeps_its_time():
    steps = np.array([5000, 5100, 5200])
    assert np.allclose(physical_times(Stamps(3, steps), timestep=1e-5).times, [0.05, 0.051, 0.052], rtol=1e-15)
    said = np.array([0.3, 0.301, 0.302])  # the clock ran before the steps were reset
    assert np.array_equal(physical_times(Stamps(3, steps, said), timestep=1e-5).times, said)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, r"--timestep SECONDS, or .* --interval SECONDS"),
        ({"interval": -1.0}, r"--interval is -1 s; it must be a positive"),
        ({"timestep": np.nan}, r"--timestep is nan s; it must be a positive"),
        (
            {"interval": 0.002, "timestep": 1e-5},
            r"contradict each other: snapshot 3 is 0.003 s .* 0.006 s by --interval",
        ),
        (
            {"said": np.array([0, 1e-3, 2e-3, 3e-3]), "timestep": 2e-5},
            r"contradict .* ITEM: TIME .* --timestep 2e-05 s",
        ),
        ({"said": np.array([0, 1e-3, 1e-3, 3e-3])}, r"time 0.001 s of snapshot 2 does not come after 0.001 s"),
        (
            {"steps": np.array([0, 100, 50, 150]), "interval": 1.0},
            r"time step 50 of snapshot 2 does not come after 100",
        ),
        (
            {"steps": np.array([0, 100, 300, 400]), "interval": 1.0},
            r"steps 100 and 300 are 200 apart, the first two 100",
        ),
    ],
    ids=["unknown", "negative", "NaN", "interval", "timestep", "stands still", "goes back", "a gap"],
)
def test_times_that_are_unknown_or_contradictory_are_refused(options, says):
    stamps = Stamps(4, options.get("steps", np.array(STEPS)), options.get("said"), "ITEM: TIME of the source")
    given = {name: value for name, value in options.items() if name in ("interval", "timestep")}
    with pytest.raises(Refusal, match=says):
        physical_times(stamps, **given)


def test_a_source_without_step_numbers_needs_the_interval():
    assert np.array_equal(physical_times(Stamps(3), interval=0.5).times, [0.0, 0.5, 1.0])
    with pytest.raises(Refusal, match=r"--timestep 1e-05 s: the source does not number its time steps; .* --interval"):
        physical_times(Stamps(3), timestep=1e-5)
