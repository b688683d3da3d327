"""How much simulation data suffices to train a surrogate of a granular flow, and what each choice costs.

From Python, what the command line answers:

    run = Run("run.h5")                                     # simulated or imported: its facts
    found = select_run(run, ["position.z"])                 # K_f per Δτ, coloured by verdict
    costs = compare_run(run, ["position.z"], [0.003])       # error against cost of every surrogate
    plot(found)                                             # or costs, a sweep, a candidate, a basis

Names are loaded when they are first used, so that `suffice --help` answers at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from suffice.answers import Selection, Tradeoff
    from suffice.beyond import compare_beyond
    from suffice.compare import compare as compare_run
    from suffice.figures import plot
    from suffice.readers.importing import import_run
    from suffice.refusal import Refusal
    from suffice.run import Run
    from suffice.selecting import select_run
    from suffice.watched import compare_observables

__all__ = [
    "Refusal",
    "Run",
    "Selection",
    "Tradeoff",
    "compare_beyond",
    "compare_observables",
    "compare_run",
    "import_run",
    "plot",
    "select_run",
]

_HOMES = {
    "Refusal": "suffice.refusal",
    "Run": "suffice.run",
    "Selection": "suffice.answers",
    "Tradeoff": "suffice.answers",
    "compare_beyond": "suffice.beyond",
    "compare_observables": "suffice.watched",
    "compare_run": "suffice.compare:compare",  # `suffice.compare` itself is the module
    "import_run": "suffice.readers.importing",
    "plot": "suffice.figures",
    "select_run": "suffice.selecting",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'suffice' has no attribute {name!r}; it has {', '.join(__all__)}")
    module, _, own = _HOMES[name].partition(":")
    found = globals()[name] = getattr(import_module(module), own or name)
    return found


def __dir__() -> list[str]:
    """Return the public names alone, for completion: not the modules that they have loaded."""
    return list(__all__)
