"""docs/adding-an-effect.md is followed to the letter in a copy of the sources; the outcome is built and tested."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "adding-an-effect.md"
COPIED = ("csrc", "cesim", "tests", "benchmarks", "docs", "setup.py", "pyproject.toml", "README.md", "LICENSE")

NEW = re.compile(r"^`([^`]+)`, new:\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EDIT = re.compile(r"^In `([^`]+)`, (after|before) `([^`]+)`:\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def apply(text, folder):
    """Writes the new files of the page and inserts its lines; each place must be there once."""
    for name, body in NEW.findall(text):
        assert not (folder / name).exists(), f"{name} is there already"
        (folder / name).write_text(body, encoding="utf-8")
    for name, where, anchor, body in EDIT.findall(text):
        lines = (folder / name).read_text(encoding="utf-8").splitlines(keepends=True)
        place = [k for k, line in enumerate(lines) if line.rstrip("\n") == anchor]
        assert len(place) == 1, f"{name} has the line {anchor!r} {len(place)} times"
        lines.insert(place[0] + (where == "after"), body)
        (folder / name).write_text("".join(lines), encoding="utf-8")


def test_the_page_names_places_that_the_sources_have(tmp_path):
    """The quick half: the page can be followed."""
    text = PAGE.read_text(encoding="utf-8")
    for name, *_ in NEW.findall(text) + EDIT.findall(text):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).exists():
            shutil.copy(ROOT / name, tmp_path / name)
    apply(text, tmp_path)
    assert len(NEW.findall(text)) == 2
    assert len(EDIT.findall(text)) == 3
    assert "&ces_buoyancy," in (tmp_path / "csrc/effects/table.c").read_text()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which(os.environ.get("CC", "cc").split()[-1]) is None, reason="there is no C compiler (CC)")
def test_what_the_page_adds_builds_and_passes_its_own_test(tmp_path):
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
        elif source.exists():
            shutil.copy(source, tmp_path / name)
    text = PAGE.read_text(encoding="utf-8")
    apply(text, tmp_path)
    commands = COMMANDS.search(text)[1].splitlines()
    assert len(commands) == 4
    environment = {**os.environ, "CESIM_WERROR": "1", "PYTHONPATH": str(tmp_path)}
    seen = []
    for command in commands:
        done = subprocess.run(
            [sys.executable, *command.split()[1:]],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        seen.append(done.stdout)
    assert re.search(r"\d+ passed", seen[1])
    assert re.search(r"^buoyancy +off +0\.00115", seen[2], re.MULTILINE)
    assert "holds" in seen[3] or "not counted" in seen[3]
