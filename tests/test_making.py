"""Surrogates made by name get what they take and nothing else."""

from suffice.making import is_trained, made
from surrogates import SURROGATES


def test_networks_get_seed_and_limit_and_others_nothing():
    assert [name for name in SURROGATES if is_trained(name)] == ["mlp", "lstm"]
    network = made("mlp", 7, 2.5)
    assert network.settings()["seed"] == 7
    assert network.settings()["max_seconds"] == 2.5
    assert "seed" not in made("spline", 7, 2.5).settings()
