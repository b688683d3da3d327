"""Broken and hostile states of our own, from which a command goes on: checkpoints, trainings, plans, results."""

import json
from pathlib import Path

from foreign_mutants import put_in_place, some_file
from mutants import Rng, mutate_file, mutate_hdf5, mutated_bytes, mutated_header, mutated_json, mutated_text, one_of

LOG = "stages.json"


def mutate_checkpoint(rng: Rng, path: Path) -> None:
    """Change the state of an interrupted run, or put something else in its place."""
    if rng.integers(15):
        mutate_hdf5(rng, path)
    else:
        put_in_place(rng, path)


def mutate_training(rng: Rng, folder: Path) -> None:
    """Change the state of an interrupted training: its header, what it says of itself, or its bytes."""
    path, what = folder / "training.safetensors", rng.integers(10)
    if what <= 2:
        mutate_file(path, lambda content: mutated_header(rng, content))
    elif what <= 6:
        mutate_file(path, lambda content: mutated_header(rng, content, _mutated_facts))
    elif what <= 8:
        mutate_file(path, lambda content: mutated_bytes(rng, content, one_of(rng, (None, 2000))))
    else:
        put_in_place(rng, path)


def _mutated_facts(rng: Rng, header: bytes) -> bytes:
    """Change what is said of the training, which stands as JSON within JSON."""
    tree = json.loads(header)
    key = one_of(rng, list(tree["__metadata__"]))
    tree["__metadata__"][key] = mutated_json(rng, tree["__metadata__"][key].encode()).decode()
    return json.dumps(tree).encode()


def mutate_combined(rng: Rng, folder: Path) -> None:
    """Change the plan or a card of a combined model, or a file of one of its parts."""
    cards = [path for path in sorted(folder.rglob("*.json")) if path.parent == folder]
    what = rng.integers(8)
    path = one_of(rng, cards) if what <= 4 else some_file(rng, folder)
    if path.suffix == ".json" and what <= 5:
        mutate_file(path, lambda text: mutated_json(rng, text))
    elif what == 6:
        mutate_file(path, lambda content: mutated_text(rng, content))
    elif what == 7:
        put_in_place(rng, path)
    else:
        mutate_file(path, lambda content: mutated_bytes(rng, content, 3000))


def mutate_results(rng: Rng, folder: Path) -> None:
    """Change a JSON of a finished study; in half of the cases so that the study takes it for its own."""
    path = one_of(rng, sorted(folder.glob("*.json")))
    before = _stamp(path)
    if rng.integers(12) == 0:
        put_in_place(rng, path)
        return
    how = mutated_json if rng.integers(4) else mutated_text
    mutate_file(path, lambda text: how(rng, text))
    if path.name != LOG and rng.integers(2):
        _own(folder / LOG, before, _stamp(path))


def _stamp(path: Path) -> list[int]:
    stat = path.stat()
    return [stat.st_size, stat.st_mtime_ns]


def _own(log: Path, before: list[int], now: list[int]) -> None:
    """Let the log of a study tell size and time of an output as they are now."""
    told = json.loads(log.read_text())
    for entry in told.values():
        entry["outputs"] = [now if output == before else output for output in entry["outputs"]]
    log.write_text(json.dumps(told))
