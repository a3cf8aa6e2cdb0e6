"""The shape of the C sources: who may include whom, who may know OpenMP, what the built engine shows to the world."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

CSRC = Path(__file__).resolve().parents[2] / "csrc"
LAYERS = ["base", "data", "field", "contact", "effects", "scene", "python"]
MOST_LINES = 520

SOURCES = sorted(path for path in CSRC.rglob("*") if path.suffix in (".c", ".h"))


def name_of(path):
    return path.relative_to(CSRC).as_posix()


def included_files(path):
    """The project's own headers that a file includes, as paths."""
    quoted = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [(path.parent / header).resolve() for header in quoted]


def upward_includes(path):
    own_layer = LAYERS.index(path.relative_to(CSRC).parts[0])
    upward = []
    for header in included_files(path):
        parts = header.relative_to(CSRC).parts
        if parts != ("cesim.h",) and LAYERS.index(parts[0]) > own_layer:
            upward.append("/".join(parts))
    return upward


def test_there_are_sources_in_every_layer():
    assert {path.relative_to(CSRC).parts[0] for path in SOURCES} == {*LAYERS, "cesim.h"}


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_every_include_exists(path):
    assert [str(header) for header in included_files(path) if not header.is_file()] == []


@pytest.mark.parametrize("path", [path for path in SOURCES if path.parent != CSRC], ids=name_of)
def test_a_folder_includes_only_itself_and_the_layers_below(path):
    assert upward_includes(path) == []


def test_the_public_header_stands_alone():
    assert included_files(CSRC / "cesim.h") == []


def test_an_upward_include_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "CSRC", tmp_path)
    low = tmp_path / "contact" / "cone.h"
    low.parent.mkdir()
    low.write_text('#include "../cesim.h"\n#include "../base/vec3.h"\n  # include "../effects/effect.h"\n')
    assert upward_includes(low) == ["effects/effect.h"]


def test_only_the_python_layer_knows_python():
    knowing = {name_of(path) for path in SOURCES if re.search(r"#\s*include\s+[<\"](Python|numpy/)", path.read_text())}
    assert all(name.startswith("python/") for name in knowing)


def test_only_parallel_c_knows_openmp():
    pattern = re.compile(r"#\s*pragma\s+omp|_Pragma\s*\(\s*\"omp|\bomp\.h\b|\bomp_[a-z_]+\s*\(")
    assert [name_of(path) for path in SOURCES if pattern.search(path.read_text())] == ["base/parallel.c"]


def test_every_effect_has_its_row_in_the_table():
    table = (CSRC / "effects" / "table.c").read_text()
    table = table[table.index("{") :]  # past the includes
    effects = [path.stem for path in (CSRC / "effects").glob("*.c") if path.stem != "table"]
    assert effects, "there are no effects"
    assert [name for name in effects if not re.search(rf"\bces_{name}\b", table)] == []


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_a_file_stays_readable_in_one_sitting(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) < MOST_LINES


def test_the_built_engine_exports_nothing_but_its_entry():
    engine = pytest.importorskip("cesim.engine", reason="the engine is not built")
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("there is no nm on this machine")
    command = [nm, "-D", "--defined-only", engine.__file__]
    listing = subprocess.run(command, capture_output=True, text=True, check=False)
    if listing.returncode != 0:
        pytest.skip(f"nm cannot list dynamic symbols here: {listing.stderr.strip()}")
    symbols = {line.split()[-1] for line in listing.stdout.splitlines() if line.strip()}
    linker_made = {"_init", "_fini", "_edata", "_end", "__bss_start"}
    # Instrumented by a sanitizer, an object also shows the sanitizer's own names.
    symbols = {name for name in symbols - linker_made if not name.startswith(("__asan_", "__odr_asan", "__ubsan_"))}
    assert symbols == {"PyInit_engine"}
