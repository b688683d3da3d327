"""What made a run: the scene as written and as run, versions and machine."""

import json
import platform
import subprocess
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba

from sim import Scene
from suffice.run import Run
from suffice.starting import read_start, start_digest


def git_revision() -> str:
    """Return the revision of the checkout that runs, or 'unknown' outside of one."""
    try:
        found = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
        )
    except OSError:
        return "unknown"
    return found.stdout.strip() or "unknown"


def provenance_of(text: str, scene: Scene) -> dict[str, str]:
    """Return what made a run: the scene as written and as run, versions and machine."""
    start = {} if scene.start is None else {"start": scene.start.run}
    return {
        "scene": text,
        "settings": _settings(scene),
        **start,
        "suffice": version("suffice"),
        "numba": numba.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "git": git_revision(),
        "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def _settings(scene: Scene) -> str:
    settings: dict[str, Any] = {"until": scene.time.duration, "seed": scene.seed}
    start = read_start(scene)
    if start is not None:
        settings["start"] = start_digest(start)
    return json.dumps(settings)


def made_otherwise(past: Run, text: str, scene: Scene) -> str:
    """Name what a run was made with that differs from this scene, `scene` or `settings`; empty if nothing does."""
    now = {"scene": text, "settings": _settings(scene)}
    return next((what for what, value in now.items() if past.provenance.get(what) != value), "")
