"""The scene or run that a command names, and the settings that change it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..result import Run
    from ..scene import Scene

DEFAULT_SCENE = "reference_machine"


def scene_of(name: str, settings: Sequence[str]) -> Scene:
    """A named scene, or one from a file, with settings applied."""
    from .. import scenes
    from ..errors import unknown
    from ..scene import load

    if name in scenes.NAMES:
        scene = scenes.NAMES[name]()
    elif name.endswith(".h5") and Path(name).exists():
        scene = scene_in(Path(name))
    elif name.endswith(".toml") or Path(name).exists():
        scene = load(name)
    else:
        raise unknown("scene", name, scenes.NAMES)
    for setting in settings:
        apply(scene, setting)
    return scene


def factors(given: Sequence[str]) -> dict[str, float]:
    """Names and numbers of "dielectrophoresis=50"."""
    from ..errors import InputError, show

    found = {}
    for text in given:
        name, _, factor = text.partition("=")
        try:
            found[name] = float(factor)
        except ValueError:
            raise InputError(f"is {show(text)}, must be EFFECT=FACTOR", path="--amplify", value=text) from None
    return found


def scene_in(path: Path) -> Scene:
    """The scene of a result file or of an accuracy report."""
    from ..accuracy import Report
    from ..errors import InputError
    from ..result import Run
    from ..scene import Scene

    try:
        return Scene.from_toml(Report.load(path).toml)
    except InputError:
        return Run.load(path).scene


def apply(scene: Scene, setting: str) -> None:
    """Apply "drum.speed=60 rpm" or "plates[0].slope=6 deg"; null takes a part away, other values are as in JSON."""
    from ..errors import InputError, show, unknown

    key, equals, text = setting.partition("=")
    steps = re.findall(r"[^.\[\]]+", key.strip())
    if not equals or not steps:
        raise InputError(f"is {show(setting)}, must be KEY=VALUE", path="--set", value=setting)
    try:
        value = json.loads(text)
    except ValueError:
        value = text.strip()
    branch: Any = scene
    for step in steps[:-1]:
        branch = member(branch, step, key)
    last = steps[-1]
    if isinstance(branch, list):
        member(branch, last, key)
        branch[int(last)] = value
    elif hasattr(branch, "__setitem__"):
        branch[last] = value
    elif hasattr(type(branch), "model_fields"):
        setattr(branch, last, value)
    else:
        raise unknown("key", last, [])


def member(branch: Any, step: str, key: str) -> Any:
    """One step down a scene tree."""
    from ..errors import InputError, unknown

    if isinstance(branch, list):
        if not step.isdigit() or int(step) >= len(branch):
            raise InputError(f"is not there: {key!r} needs an index below {len(branch)}", path=f"[{step}]")
        return branch[int(step)]
    if hasattr(branch, "__getitem__"):
        if step not in branch:
            raise unknown("key", step, branch)
        return branch[step]
    fields = getattr(type(branch), "model_fields", {})
    names = [field.alias or name for name, field in fields.items()]
    if step not in names:
        raise unknown("key", step, names)
    below = getattr(branch, step)
    if below is None:
        raise InputError("is not in this scene", path=step)
    return below


def run_of(name: str) -> Run | None:
    """The run in a result file; None where the name is that of a scene."""
    from .. import scenes
    from ..result import Run

    is_run = name not in scenes.NAMES and not name.endswith(".toml") and Path(name).is_file()
    return Run.load(name) if is_run else None
