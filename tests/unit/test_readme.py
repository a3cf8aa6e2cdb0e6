"""What the README tells to type runs."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cesim

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8") if (ROOT / "README.md").is_file() else ""
PYTHON = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)

pytestmark = pytest.mark.skipif(not TEXT, reason="the README is not beside the tests")


def test_the_lines_of_python_run(capsys):
    """One after the other, as on a page, with less simulated time."""
    names = {}
    assert len(PYTHON) == 2
    for lines in PYTHON:
        exec(lines.replace('until="2 s"', 'until="1 s"'), names)
    said = capsys.readouterr().out
    assert "material      product" in said
    assert names["sim"].count == 1


def test_the_scene_file_is_a_scene():
    (text,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    scene = cesim.scene.Scene.from_toml(text)
    scene.check()
    assert scene.name == "shredded cable"


def test_the_answers_of_how_do_i_run():
    """Every line of Python in the table that stands for itself, on the reference machine."""
    answers = re.findall(r"^\| .*? \| (.*) \|$", TEXT, re.MULTILINE)
    code = [part for answer in answers for part in re.findall(r"`([^`]+)`", answer)]
    assignments = [line for line in code if re.match(r"scene\.[a-z_.\[\]\"]+ = ", line)]
    assert len(assignments) >= 4
    scene = cesim.scenes.reference_machine("spheres")
    for line in assignments:
        exec(line, {"scene": scene, "cesim": cesim})
    scene.check()


def test_files_that_are_named_are_there():
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", TEXT) if "://" not in link]
    assert len(links) > 20
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_sources_without_their_engine_say_what_to_do(tmp_path):
    """As in a checkout into which nothing was built, where Python finds the sources before the installed package."""
    keep = shutil.ignore_patterns("*.so", "*.pyd", "__pycache__")
    shutil.copytree(Path(cesim.__file__).parent, tmp_path / "cesim", ignore=keep)
    command = [sys.executable, "-S", "-c", "import cesim; cesim.engine"]  # without what is installed
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "pip install -e ." in done.stderr.splitlines()[-1]
