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
        "settings": json.dumps(_settings(scene)),
        **start,
        "suffice": version("suffice"),
        "numba": numba.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "git": git_revision(),
        "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def _settings(scene: Scene) -> dict[str, Any]:
    settings: dict[str, Any] = {"until": scene.time.duration, "seed": scene.seed}
    start = read_start(scene)
    if start is not None:
        settings["start"] = start_digest(start)
    return settings


def made_otherwise(past: Run, text: str, scene: Scene) -> str:
    """Name what a run was made with that differs from this scene, `scene` or a setting; empty if nothing does."""
    if past.provenance.get("scene") != text:
        return "scene"
    before, now = _settings_of(past), _settings(scene)
    if before.get("start") != now.get("start"):
        return "start"
    if before.get("until") != now["until"]:
        return f"end ({before.get('until')} s, now {now['until']} s)"
    return "" if before.get("seed") == now["seed"] else f"seed ({before.get('seed')}, now {now['seed']})"


def _settings_of(past: Run) -> dict[str, Any]:
    """Return the settings that stand in a run; empty where it has none, or a damaged text."""
    try:
        settings = json.loads(past.provenance.get("settings", ""))
    except ValueError:
        return {}
    return settings if isinstance(settings, dict) else {}
