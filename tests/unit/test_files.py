"""Result and restart files: complete, readable while written, atomic, and never believed when damaged."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from streams import stream

import cesim
from cesim import InputError


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "run.h5"
    cesim.run(stream(), seed=3, threads=1, until="0.3 s", save=path, progress=False)
    return path


@pytest.fixture
def copy(saved, tmp_path):
    path = tmp_path / "copy.h5"
    path.write_bytes(saved.read_bytes())
    return path


def small_restart(path):
    sim = cesim.Simulation(stream(), seed=2, threads=1)
    sim.step(30)
    sim.save(path)
    return sim


def test_a_run_from_its_file_equals_the_run_in_memory(saved):
    memory = cesim.run(stream(), seed=3, threads=1, until="0.3 s", progress=False)
    file = cesim.open(saved)
    assert np.array_equal(memory.landings, file.landings)
    assert len(file.landings) > 1000
    assert memory.balance == file.balance
    assert memory.health.total_iterations == file.health.total_iterations
    for name, column in memory.frames.items():
        assert np.array_equal(column, file.frames[name])
    assert memory.grade("copper") == file.grade("copper")
    assert file.complete
    assert file.time == pytest.approx(0.3)


def test_the_file_holds_what_its_layout_promises(saved):
    with h5py.File(saved) as file:
        assert file.attrs["filetype"] == "cesim-run"
        assert file.attrs["schema"].tolist() == [1, 0]
        assert file.attrs["complete"]
        assert file.attrs["seed"] == 3
        for name in ("version", "created", "finished", "scene_hash", "build", "host", "wall_time"):
            assert name in file.attrs
        for name in ("toml", "resolved", "effects", "citations"):
            assert len(file["scene"][name][()]) > 0
        landings, particles = file["landings"], file["particles"]
        assert {"id", "t", "x", "y", "z", "velocity", "charge", "surface", "collisions"} <= set(landings.dtype.names)
        fed, landed, resident, lost = (landings.attrs[n] for n in ("fed", "landed", "resident", "lost"))
        assert fed[0] == landed[0] + resident[0] + lost[0] == len(particles)
        assert np.array_equal(particles["id"], np.arange(len(particles)))
        assert landed[0] == np.count_nonzero(landings["lost"] == 0)
        frames = file["frames"]
        assert len(frames["offset"]) == len(frames["time"]) + 1 == 31
        assert frames["offset"][-1] == len(frames["id"]) == len(frames["position"])
        assert frames["position"].dtype == frames["charge"].dtype == np.float32
        assert len(file["health"]) == 31
        assert not any(item.dtype.hasobject for item in (landings, particles, file["health"], *frames.values()))
    assert sorted(p.name for p in saved.parent.iterdir()) == ["run.h5"]


def test_bins_of_the_run_stand_in_the_file(saved):
    with h5py.File(saved) as file:
        group, bins = file["bins/landing"], cesim.open(saved).bins()
        assert np.array_equal(group["edges"][()], bins.edges)
        names = [name.decode() for name in group["materials"][()]]
        assert names == ["copper", "ABS"]
        for row, name in enumerate(names):
            for column in ("mass", "count", "ci_low", "ci_high", "n_eff"):
                assert np.array_equal(group[column][row], getattr(bins, column)[name])


def test_a_run_continues_from_its_file_bit_for_bit(saved):
    sim = cesim.Simulation.restore(saved, threads=2)
    other = cesim.Simulation(stream(), seed=3, threads=1)
    other.run("0.3 s")
    assert sim.state_hash() == other.state_hash()
    sim.step(50)
    other.step(50)
    assert sim.state_hash() == other.state_hash()
    assert np.array_equal(sim.landings, other.landings)


def test_saving_replaces_an_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "über raschung.h5"
    path.write_text("old")
    sim = small_restart(path)
    assert cesim.Simulation.restore(path).state_hash() == sim.state_hash()
    assert list(tmp_path.iterdir()) == [path]


def test_frames_can_be_all_or_none():
    everything = cesim.run(stream("2000 1/s"), until="0.05 s", progress=False, frames=cesim.Frames("5 ms", None))
    assert np.diff(everything.frames["offset"])[-1] == everything.balance.resident.count
    assert len(cesim.run(stream(), until="0.05 s", progress=False, frames=None).frames["time"]) == 0
    with pytest.raises(InputError, match="frames"):
        cesim.run(stream(), frames="10 ms")
    with pytest.raises(InputError, match=r"frames\.every"):
        cesim.Frames("0 s")


# ---- damage ----------------------------------------------------------------------------------------------------------


def refuse(path):
    with pytest.raises(InputError) as error:
        cesim.open(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value) or "/" in str(error.value)


def test_what_is_not_a_result_is_refused(tmp_path):
    for name, content in (("text", b"hello"), ("empty", b""), ("signature", b"\x89HDF\r\n\x1a\n")):
        path = tmp_path / name
        path.write_bytes(content)
        refuse(path)
    refuse(tmp_path)
    refuse(tmp_path / "missing")
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1
    refuse(tmp_path / "foreign.h5")


def test_a_missing_file_points_to_the_part_of_a_run_that_did_not_end(tmp_path):
    (tmp_path / "run.h5.part").write_bytes(b"")
    with pytest.raises(InputError, match=r"run\.h5\.part"):
        cesim.open(tmp_path / "run.h5")


def test_a_restart_file_is_no_result_file(tmp_path):
    small_restart(tmp_path / "restart.h5")
    refuse(tmp_path / "restart.h5")


@pytest.mark.parametrize("name", ["landings", "particles", "health", "frames/offset", "scene/toml", "scene/resolved"])
@pytest.mark.parametrize("how", ["missing", "soft link", "external link", "objects", "other type", "huge", "virtual"])
def test_a_table_that_is_not_what_it_must_be_is_refused(copy, name, how):
    with h5py.File(copy, "r+") as file:
        dtype = file[name].dtype
        if how == "soft link":
            file["elsewhere"] = file[name]
        del file[name]
        match how:
            case "soft link":
                file[name] = h5py.SoftLink("/elsewhere")
            case "external link":
                file[name] = h5py.ExternalLink("other.h5", "/landings")
            case "objects":
                file.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())
            case "other type":
                file.create_dataset(name, data=np.zeros((3, 2), complex))
            case "huge":
                file.create_dataset(name, (10**13,), dtype, chunks=(10**6,), compression="gzip")
            case "virtual":
                file.create_virtual_dataset(name, h5py.VirtualLayout((4,), dtype))
    with pytest.raises(InputError, match="claims" if how == "huge" else None):
        cesim.open(copy).frames  # noqa: B018


def test_a_number_that_is_not_finite_or_a_material_that_is_not_there_is_refused(copy):
    for field, value in (("x", np.nan), ("mass", np.inf), ("material", 99), ("material", -1)):
        with h5py.File(copy, "r+") as file:
            rows = file["landings"][()]
            before = rows.copy()
            rows[field][5] = value
            file["landings"][...] = rows
        refuse(copy)
        with h5py.File(copy, "r+") as file:
            file["landings"][...] = before
    cesim.open(copy)


def test_a_file_of_a_later_version_is_refused(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["schema"] = np.array([2, 0])
    with pytest.raises(InputError, match="newer cesim"):
        cesim.open(copy)


@pytest.mark.parametrize("kind", ["run", "restart"])
def test_a_truncated_file_is_refused(saved, tmp_path, kind):
    path = tmp_path / "whole.h5"
    if kind == "run":
        path.write_bytes(saved.read_bytes())
    else:
        small_restart(path)
    content = path.read_bytes()
    for end in range(0, len(content), max(4096, len(content) // 40 // 4096 * 4096)):
        path.write_bytes(content[:end])
        with pytest.raises(InputError):
            cesim.Simulation.restore(path)


FLIP = """
import sys, random
from pathlib import Path
import cesim
good, bad = Path(sys.argv[1]), Path(sys.argv[2])
content = good.read_bytes()
expected = cesim.Simulation.restore(good).state_hash()
draw = random.Random(int(sys.argv[3]))
refused = 0
for _ in range(300):
    damaged = bytearray(content)
    for _ in range(draw.choice([1, 1, 4])):
        damaged[draw.randrange(min(len(content), draw.choice([4096, len(content)])))] ^= 1 << draw.randrange(8)
    bad.write_bytes(damaged)
    try:
        assert cesim.Simulation.restore(bad, threads=1).state_hash() == expected
    except cesim.InputError:
        refused += 1
print(refused)
"""


@pytest.mark.parametrize("seed", [1, 2])
def test_flipped_bits_are_refused_or_harmless_and_never_crash(tmp_path, seed):
    small_restart(tmp_path / "good.h5")
    command = [sys.executable, "-c", FLIP, str(tmp_path / "good.h5"), str(tmp_path / "bad.h5"), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) > 50


# ---- places that cannot be written -----------------------------------------------------------------------------------


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    sim = cesim.Simulation(stream(), threads=1)
    for path in (tmp_path / "no such folder" / "x.h5", tmp_path):
        with pytest.raises(InputError, match=r"cannot be written|is a folder"):
            sim.save(path)
        with pytest.raises(InputError, match=r"cannot be written|is a folder"):
            cesim.run(stream(), until="0.01 s", save=path, progress=False)
    assert list(tmp_path.iterdir()) == []


FULL_DISK = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from streams import stream
import cesim
import cesim.runner
cesim.runner.FLUSH_EVERY = 0.0
limit = int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    cesim.run(stream(), until="2 s", save=Path(sys.argv[1]), progress=False, frames=cesim.Frames("1 ms", None))
except cesim.InputError as error:
    print(error)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no resource limits")
@pytest.mark.parametrize("limit", [5_000, 1_000_000])
def test_a_full_disk_ends_the_run_with_one_line(tmp_path, limit):
    command = [sys.executable, "-c", FULL_DISK, str(tmp_path / "run.h5"), str(Path(__file__).parents[1]), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "cannot be written" in done.stdout
    assert done.stdout.count("\n") == 1
    if limit == 5_000:
        return
    run = cesim.open(tmp_path / "run.h5.part")
    assert not run.complete
    assert len(run.frames["time"]) > 0
