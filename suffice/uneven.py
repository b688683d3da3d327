"""Runs whose snapshots are not evenly spaced: who needs even ones refuses them, and says what is known instead."""

from suffice.refusal import Refusal
from suffice.run import Run
from suffice.wording import seconds_text


def unfit(run: Run, error: Exception) -> Refusal:
    """Return the refusal of times or intervals that cannot be used, as an `error` tells.

    Of a run that `simulate` has thinned it tells what was found while it was made: it cannot be judged again, and no
    surrogate can be trained on it at a Δτ.
    """
    if "kept" not in run.found:
        return Refusal(f"{run.path}: {error}")
    thinned = f"{run.path}: --keep-error has thinned this run, its snapshots are not evenly spaced"
    known = run.found.get("in_situ")
    if known is None:
        return Refusal(
            f"{thinned}; simulate without it, or with --until-sufficient --variable, which judges every Δτ on the way"
        )
    chosen = "; ".join(
        f"{name} {'none' if found['chosen_interval'] is None else seconds_text(found['chosen_interval'])}"
        for name, found in known["variables"].items()
    )
    return Refusal(
        f"{thinned}; it was judged at {known['n_snapshots']} even times while it was made, and Δτ by the paper's rule "
        f"is: {chosen} (suffice info {run.path} says more); simulate without --keep-error for all else"
    )
