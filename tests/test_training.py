"""Training of every network: repeatable, interruptible, and honest about what was learnt."""

import csv
import pickle
import random
import signal
from itertools import count
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from surrogates.errors import InputError
from surrogates.network import seeded
from surrogates.training import Samples, Trained, Training, check_training, train
from surrogates.training_state import FILE

SETTINGS = Training(steps=40, learning_rate=1e-2, batch=7, checks=8, patience=None, seed=3)


def network(width: int = 8, seed: int = 0) -> nn.Module:
    return seeded(lambda: nn.Sequential(nn.Linear(1, width), nn.Tanh(), nn.Linear(width, 1)), seed)


def sine(count: int = 30, sign: float = 1.0) -> Samples:
    x = torch.linspace(-1, 1, count)[:, None]
    return Samples((x,), sign * torch.sin(3 * x))


def weights(trained: nn.Module) -> dict[str, bytes]:
    return {name: value.numpy().tobytes() for name, value in trained.state_dict().items()}


def run(settings: Training = SETTINGS, validation: Samples | None = None, width: int = 8) -> tuple[nn.Module, Trained]:
    learner = network(width)
    return learner, train(learner, sine(), validation or sine(11), settings)


class Stopped(Exception):  # noqa: N818 (no error)
    """Raised by a report, as a user who has seen enough."""


def stop_at(check: int, error: type[BaseException] = Stopped) -> Any:
    numbers = count(1)

    def report(_done: int, _all: int) -> None:
        if next(numbers) == check:
            raise error

    return report


def interrupt(settings: Training, check: int, validation: Samples | None = None) -> None:
    with pytest.raises(Stopped):
        run(settings._replace(report=stop_at(check)), validation)


def test_the_same_seed_gives_the_same_weights_and_another_seed_others() -> None:
    first, again, other = (weights(run(SETTINGS._replace(seed=seed))[0]) for seed in (3, 3, 4))
    assert first == again
    assert first != other


def test_the_number_of_threads_neither_changes_the_weights_nor_is_changed() -> None:
    before, found = torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            found.append(weights(run()[0]))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    assert found[0] == found[1]


def test_training_leaves_every_global_source_of_chance_alone() -> None:
    before = torch.get_rng_state(), random.getstate(), pickle.dumps(np.random.get_state())  # noqa: NPY002
    run()
    assert torch.equal(torch.get_rng_state(), before[0])
    assert random.getstate() == before[1]
    assert pickle.dumps(np.random.get_state()) == before[2]  # noqa: NPY002


@pytest.mark.parametrize("batch", [7, None])
@pytest.mark.parametrize("check", [1, 5])
def test_a_resumed_training_is_bitwise_the_one_that_was_not_interrupted(
    tmp_path: Path, batch: int | None, check: int
) -> None:
    settings = SETTINGS._replace(batch=batch)
    expected, told = run(settings)
    settings = settings._replace(folder=tmp_path)
    interrupt(settings, check)
    resumed, retold = run(settings._replace(resume=True))
    assert weights(resumed) == weights(expected)
    assert retold._replace(seconds=0.0) == told._replace(seconds=0.0)


class Slow(nn.Module):
    """A network that takes its time: it is always interrupted between two checks."""

    def __init__(self, inner: nn.Module) -> None:
        super().__init__()
        self.inner = inner

    def forward(self, x: Tensor) -> Tensor:
        sleep(0.004)
        answer: Tensor = self.inner(x)
        return answer


@pytest.mark.parametrize("batch", [7, None])
def test_a_training_whose_time_is_over_between_two_checks_goes_on_there(tmp_path: Path, batch: int | None) -> None:
    settings = SETTINGS._replace(checks=2, batch=batch)
    expected, told = run(settings)
    learner = Slow(network())
    limited = settings._replace(folder=tmp_path, max_seconds=0.06)
    first = train(learner, sine(), sine(11), limited)
    assert 0 < first.steps < 20
    assert first.reason == "max_seconds of 0.06 s were over"
    learner = Slow(network())
    last = train(learner, sine(), sine(11), limited._replace(resume=True, max_seconds=None))
    assert weights(learner.inner) == weights(expected)
    assert (last.steps, last.best_step, last.error) == (told.steps, told.best_step, told.error)
    assert (first.early, last.early) == (True, False)


def test_patience_counts_on_where_a_training_was_interrupted(tmp_path: Path) -> None:
    against = sine(11, sign=-1.0)  # validation that only gets worse
    settings = SETTINGS._replace(patience=4)
    expected, told = run(settings, against)
    assert told.steps == 20  # four checks of five steps
    settings = settings._replace(folder=tmp_path)
    interrupt(settings, 2, against)
    resumed, retold = run(settings._replace(resume=True), against)
    assert retold.steps == 20
    assert weights(resumed) == weights(expected)
    assert run(settings._replace(resume=True), against)[1].steps == 20  # and a third time nothing is left to do


def test_a_finished_training_is_resumed_without_a_step(tmp_path: Path) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    expected, told = run(settings)
    resumed, retold = run(settings._replace(resume=True, report=stop_at(1)))
    assert weights(resumed) == weights(expected)
    assert (retold.steps, retold.reason) == (told.steps, "all steps done")


def test_weights_that_nothing_improves_are_those_the_network_was_born_with() -> None:
    learner, told = run(SETTINGS._replace(patience=3), sine(11, sign=-1.0))
    assert (told.best_step, told.reason) == (0, "no improvement on the untrained network")
    assert weights(learner) == weights(network())


def test_the_weights_kept_have_the_error_that_is_told() -> None:
    learner, told = run()
    (x,), y = sine(11)
    with torch.no_grad():
        assert float(((learner(x) - y) ** 2).mean()) ** 0.5 == pytest.approx(told.error, rel=1e-6)
    assert told.error < 0.5  # the sine itself is 0.7
    assert not learner.training


def test_patience_says_since_when_nothing_improved() -> None:
    few = Samples((torch.tensor([[-1.0], [1.0]]),), torch.tensor([[-1.0], [1.0]]))
    learner = network()
    told = train(learner, few, sine(11), Training(steps=2000, learning_rate=0.05, checks=400, patience=5))
    assert 0 < told.best_step == told.steps - 25
    assert told.reason == f"no improvement since step {told.best_step}"


@pytest.mark.parametrize(("steps", "checks"), [(11, 4), (7, 40), (1, 1)])
def test_every_step_is_done_and_reported_where_checks_do_not_divide_them(steps: int, checks: int) -> None:
    seen: list[tuple[int, int]] = []
    settings = SETTINGS._replace(steps=steps, checks=checks, report=lambda done, total: seen.append((done, total)))
    told = run(settings)[1]
    assert (told.steps, told.reason) == (steps, "all steps done")
    assert seen[-1] == (steps, steps)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})


def test_a_rate_far_too_high_is_refused_by_its_name() -> None:
    with pytest.raises(InputError, match=r"learning_rate is 1e\+06: .* without bound by step \d+; give a tenth"):
        run(SETTINGS._replace(learning_rate=1e6))


class Bursting(nn.Module):
    """A network that learns, until its answers overflow at a given step."""

    def __init__(self, inner: nn.Module, step: int) -> None:
        super().__init__()
        self.inner, self.left = inner, step

    def forward(self, x: Tensor) -> Tensor:
        self.left -= self.training
        answer: Tensor = self.inner(x)
        return answer if self.left > 0 else answer * float("inf")


def test_a_training_that_diverges_late_keeps_the_best_and_says_at_which_step() -> None:
    learner = Bursting(network(), 23)
    told = train(learner, sine(), None, SETTINGS._replace(batch=None, learning_rate=3e-3))
    assert told.steps == 23
    assert told.best_step == 20  # the last check before
    assert told.reason.startswith("the error grew without bound at step 23, the weights of step 20 are kept; a smaller")
    assert all(value.isfinite().all() for value in learner.inner.parameters())
    assert told.error < 0.7


def test_without_a_folder_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run()
    assert not list(tmp_path.iterdir())


def test_a_folder_gets_a_state_and_a_table_of_errors_that_resuming_leaves_alone(tmp_path: Path) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    interrupt(settings, 5)
    run(settings._replace(resume=True))
    before, after = (tmp_path / "log" / part / "metrics.csv" for part in ("", "from_step_25"))
    with before.open() as file:
        rows = [row for row in csv.DictReader(file) if row["validation"]]
    assert len(rows) in (4, 5)  # the report that interrupts comes before the fifth line is written
    assert all(0 < float(row["validation"]) < 2 for row in rows)
    with after.open() as file:
        assert sum(bool(row["validation"]) for row in csv.DictReader(file)) == 3
    assert (tmp_path / FILE).exists()
    assert not list(tmp_path.glob("*.part"))


def test_ctrl_c_stays_ctrl_c_and_a_second_one_is_heard(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run(SETTINGS._replace(folder=tmp_path, report=stop_at(3, KeyboardInterrupt)))
    assert signal.getsignal(signal.SIGINT) is before
    assert weights(run(SETTINGS._replace(folder=tmp_path, resume=True))[0]) == weights(run()[0])


def test_a_resume_without_any_state_begins_anew(tmp_path: Path) -> None:
    assert weights(run(SETTINGS._replace(folder=tmp_path, resume=True))[0]) == weights(run()[0])


class Trap:
    """What a hostile file would have executed."""

    def __init__(self, place: Path) -> None:
        self.place = place

    def __reduce__(self) -> Any:
        return Path.touch, (self.place,)


def test_a_state_that_is_damaged_or_hostile_is_refused_and_never_executed(tmp_path: Path) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    run(settings)
    whole = (tmp_path / FILE).read_bytes()
    sprung = tmp_path / "sprung"
    header = (len(whole) // 2).to_bytes(8, "little")
    for content in (b"", whole[:-9], whole[:50], header + whole[8:], pickle.dumps(Trap(sprung)), b"PK\x03\x04" * 9):
        (tmp_path / FILE).write_bytes(content)
        with pytest.raises(InputError, match=rf"{FILE} is damaged .*; remove it and start the training anew"):
            run(settings._replace(resume=True))
    torch.save({"last": Trap(sprung)}, tmp_path / FILE)
    with pytest.raises(InputError, match="is damaged"):
        run(settings._replace(resume=True))
    assert not sprung.exists()


def content(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    with safe_open(path, framework="pt") as file:
        return {key: file.get_tensor(key) for key in file.keys()}, file.metadata()  # noqa: SIM118 (not a dict)


@pytest.mark.parametrize(
    "facts", ["", "[]", "{}", '{"steps": "many"}', "[" * 100_000, '{"steps": 1e999}', "null"], ids=lambda f: f[:12]
)
@pytest.mark.parametrize("which", ["facts", "settings"])
def test_a_state_whose_facts_or_settings_make_no_sense_is_refused(tmp_path: Path, which: str, facts: str) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    run(settings)
    tensors, known = content(tmp_path / FILE)
    save_file(tensors, tmp_path / FILE, metadata=known | {which: facts})
    with pytest.raises(InputError, match=f"{FILE} is damaged"):
        run(settings._replace(resume=True))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("moments/0.step", None, "of another network"),
        ("moments/x.step", torch.zeros(()), "of another network"),
        ("moments/0.exp_avg", torch.zeros(5), "of another network"),
        ("moments/1.exp_avg_sq", torch.full((8,), torch.nan), "not finite"),
        ("best/network.0.weight", None, "of another network"),
        ("last/network.0.weight", torch.full((8, 1), torch.inf), "not finite"),
        ("other/weight", torch.zeros(1), "is damaged"),
    ],
)
def test_a_foreign_tensor_is_refused(tmp_path: Path, key: str, value: Tensor | None, message: str) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    interrupt(settings, 2)
    tensors, facts = content(tmp_path / FILE)
    changed = {name: t for name, t in tensors.items() if name != key} | ({} if value is None else {key: value})
    save_file(changed, tmp_path / FILE, metadata=facts)
    with pytest.raises(InputError, match=message):
        run(settings._replace(resume=True))


def test_the_state_of_another_network_or_of_other_data_is_refused(tmp_path: Path) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    interrupt(settings, 4)
    with pytest.raises(InputError, match="of another network; start it anew"):
        run(settings._replace(resume=True), width=9)
    with pytest.raises(InputError, match=r"of other data: its best weights missed by 0\.\d+ there and miss by 1\.\d+"):
        run(settings._replace(resume=True), sine(11, sign=-1.0))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"learning_rate": 2e-2},
            "learning_rate is 0.02, the training to be resumed was begun with 0.01; give the same",
        ),
        ({"steps": 80}, "steps is 80, the training to be resumed was begun with 40"),
        ({"seed": 4}, "seed is 4, the training to be resumed was begun with 3"),
        ({"batch": None}, "batch is none, the training to be resumed was begun with 7"),
        ({"weight_decay": 0.1}, "weight_decay is 0.1"),
        ({"patience": 3}, "patience is 3, the training to be resumed was begun with none"),
    ],
)
def test_a_training_is_not_resumed_with_other_settings(tmp_path: Path, change: dict[str, Any], says: str) -> None:
    settings = SETTINGS._replace(folder=tmp_path)
    interrupt(settings, 4)
    with pytest.raises(InputError, match=says):
        run(settings._replace(resume=True, **change))
    run(settings._replace(resume=True, max_seconds=60.0))  # how long it may take decides no step


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"steps": 0}, "steps is 0; give at least 1"),
        ({"checks": 0}, "checks is 0"),
        ({"batch": 0}, "batch is 0"),
        ({"patience": 0}, "patience is 0"),
        ({"learning_rate": 0.0}, "learning_rate is 0; give a positive number"),
        ({"learning_rate": float("nan")}, "learning_rate is nan"),
        ({"max_seconds": -1.0}, "max_seconds is -1"),
        ({"weight_decay": -0.1}, "weight_decay is -0.1"),
        ({"seed": -1}, "seed is -1"),
        ({"resume": True}, "resume is asked for without a folder"),
    ],
)
def test_settings_that_no_training_can_have_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_training(Training(**wrong))
