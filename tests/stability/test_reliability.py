"""Killed, interrupted, forked, moved to another process: what was computed is kept, and it goes on where it stopped."""

import contextlib
import functools
import gc
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from streams import stream

import cesim

TESTS = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="POSIX only")


def python(code, *arguments, **options):
    """A process that runs code with the helpers of the tests at hand, and says "ready" when it is about to begin."""
    code = f"import sys; sys.path.insert(0, {str(TESTS)!r})\nimport cesim\nfrom streams import stream\n{code}"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code, *map(str, arguments)], **pipes, **options)


# ---- save and restore ------------------------------------------------------------------------------------------------

CONTINUE = """
sim = cesim.Simulation.restore(sys.argv[1], threads=int(sys.argv[2]))
sim.step(int(sys.argv[3]))
print(sim.state_hash(), sim.time, len(sim.landings))
"""


@pytest.mark.parametrize("k", [0, 1, 7, 300])
def test_a_saved_state_continues_bit_for_bit_in_a_new_process_with_other_threads(tmp_path, k):
    sim = cesim.Simulation(stream(), seed=9, threads=2)
    sim.step(k)
    sim.save(tmp_path / "state.h5")
    sim.step(150)
    for threads in (1, 3):
        child = python(CONTINUE, tmp_path / "state.h5", threads, 150)
        out, err = child.communicate(timeout=60)
        assert out.split() == [str(sim.state_hash()), str(sim.time), str(len(sim.landings))], err


def test_the_machine_in_full_swing_continues_bit_for_bit(tmp_path):
    sim = cesim.Simulation(cesim.scenes.reference_machine("spheres"), seed=4, threads=1)
    sim.step(700)
    assert sim.health.contacts > 50
    sim.save(tmp_path / "state.h5")
    twin = cesim.Simulation.restore(tmp_path / "state.h5", threads=2)
    assert twin.state_hash() == sim.state_hash()
    for simulation in (sim, twin):
        simulation.step(100)
    assert twin.state_hash() == sim.state_hash()
    assert np.array_equal(twin.contacts, sim.contacts)
    assert twin.balance == sim.balance


def test_a_state_does_not_fit_another_scene(tmp_path):
    h5py = pytest.importorskip("h5py")
    sim = cesim.Simulation(stream(), threads=1)
    sim.step(20)
    sim.save(tmp_path / "state.h5")
    other = cesim.Simulation(cesim.scenes.settling_box(), threads=1)
    other.save(tmp_path / "other.h5")
    with h5py.File(tmp_path / "state.h5", "r+") as file, h5py.File(tmp_path / "other.h5") as source:
        del file["scene"]
        source.copy("scene", file)
    with pytest.raises(cesim.InputError, match="digest"):
        cesim.Simulation.restore(tmp_path / "state.h5")


# ---- kill -9 ---------------------------------------------------------------------------------------------------------

RUN = """
import cesim.runner
cesim.runner.FLUSH_EVERY, cesim.runner.RESTART_EVERY = 0.02, 0.1
print("ready", flush=True)
cesim.run(stream(), seed=2, threads=1, until=sys.argv[2], save=sys.argv[1], progress=False)
"""


def test_a_run_killed_at_any_instant_leaves_its_newest_rows(tmp_path):
    path, part = tmp_path / "run.h5", tmp_path / "run.h5.part"
    whole = cesim.run(stream(), seed=2, threads=1, until="1 s", progress=False)
    draw = random.Random(1)
    readable = restarts = 0
    for _ in range(20):
        child = python(RUN, path, "100 s")
        assert child.stdout.readline() == "ready\n"
        delay = draw.uniform(0.0, 0.8)
        time.sleep(delay)
        child.kill()
        child.communicate()
        assert not path.exists()
        if part.exists() and (delay > 0.3 or is_readable(part)):
            run = cesim.open(part)
            assert not run.complete
            n = min(len(run.landings), len(whole.landings))
            assert np.array_equal(run.landings[:n], whole.landings[:n])
            assert np.isfinite(run.frames["position"]).all()
            assert len(run.frames["offset"]) == len(run.frames["time"]) + 1
            str(run)
            readable += n > 100
        restart = tmp_path / "run.h5.restart"
        if restart.exists():
            sim = cesim.Simulation.restore(restart)
            assert sim.time > 0
            restarts += 1
        for leftover in tmp_path.iterdir():
            leftover.unlink()
    assert readable >= 5
    assert restarts >= 3


def is_readable(part):
    try:
        return bool(cesim.open(part))
    except cesim.InputError:
        return False  # killed before all tables were made


def test_a_killed_save_leaves_the_old_file_whole(tmp_path):
    path = tmp_path / "state.h5"
    sim = cesim.Simulation(stream(), threads=1)
    sim.step(50)
    sim.save(path)
    code = "sim = cesim.Simulation.restore(sys.argv[1])\nprint('ready', flush=True)\nwhile True: sim.save(sys.argv[1])"
    draw = random.Random(2)
    for _ in range(10):
        child = python(code, path)
        assert child.stdout.readline() == "ready\n"
        time.sleep(draw.uniform(0, 0.1))
        child.kill()
        child.communicate()
        assert cesim.Simulation.restore(path).state_hash() == sim.state_hash()


def test_a_run_can_be_read_while_it_goes_on(tmp_path):
    child = python(RUN, tmp_path / "run.h5", "100 s")
    assert child.stdout.readline() == "ready\n"
    end, landed = time.monotonic() + 30, []
    while len(set(landed)) < 4 and time.monotonic() < end:
        time.sleep(0.1)
        if (tmp_path / "run.h5.part").exists() and is_readable(tmp_path / "run.h5.part"):
            landed.append(len(cesim.open(tmp_path / "run.h5.part").landings))
    child.kill()
    child.communicate()
    assert landed == sorted(landed)
    assert len(set(landed)) >= 4


# ---- Ctrl-C ----------------------------------------------------------------------------------------------------------


def test_ctrl_c_ends_a_step_at_once_with_a_whole_state(tmp_path):
    code = """
import os, threading, time, signal
sim = cesim.Simulation(stream("100000 1/s"), seed=3, threads=2)
signal.signal(signal.SIGINT, signal.default_int_handler)
def interrupt():
    global sent
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)
threading.Timer(0.5, interrupt).start()
try:
    sim.step(10**6)
except KeyboardInterrupt:
    late = time.monotonic() - sent
n = sim.engine.step_index
other = cesim.Simulation(stream("100000 1/s"), seed=3, threads=1)
other.step(n)
assert other.state_hash() == sim.state_hash()
sim.step(5)
sim.save(sys.argv[1])
assert cesim.Simulation.restore(sys.argv[1]).state_hash() == sim.state_hash()
print(n, late)
"""
    out, err = python(code, tmp_path / "state.h5").communicate(timeout=100)
    assert err == ""
    steps, late = out.split()
    assert int(steps) > 10
    assert float(late) < 0.2


@pytest.mark.parametrize(
    ("number", "code", "before"),
    [
        (signal.SIGINT, 130, signal.default_int_handler),
        (signal.SIGTERM, 143, signal.default_int_handler),
        (signal.SIGTERM, 143, signal.SIG_IGN),
    ],
    ids=["ctrl-c", "terminated", "terminated in the background"],
)
def test_ctrl_c_keeps_what_was_computed_and_says_so(tmp_path, number, code, before):
    stream().save(tmp_path / "s.toml")
    command = [sys.executable, "-m", "cesim", "run", "s.toml", "--until", "1000 s", "--threads", "1", "--no-figure"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # A process in the background ignores SIGINT, and so do its children.
    prepare = functools.partial(signal.signal, signal.SIGINT, before)
    child = subprocess.Popen(command, cwd=tmp_path, preexec_fn=prepare, **pipes)
    end = time.monotonic() + 30
    while not (tmp_path / "run.h5.part").exists() and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(1.5)
    sent = time.monotonic()
    child.send_signal(number)
    out, err = child.communicate(timeout=30)
    assert time.monotonic() - sent < 5  # the step ends at once; the rest is writing and Python's exit
    assert child.returncode == code
    assert "Traceback" not in err
    assert "stopped before its end" in out
    assert "recovery" in out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.h5", "s.toml"]
    run = cesim.open(tmp_path / "run.h5")
    assert not run.complete
    sim = cesim.Simulation.restore(tmp_path / "run.h5")
    assert sim.time == pytest.approx(run.time)
    assert len(sim.landings) == len(run.landings) > 0
    sim.step(10)


# ---- fork, spawn, memory ---------------------------------------------------------------------------------------------


def hash_after(steps, threads=2):
    sim = cesim.Simulation(stream("50000 1/s"), seed=6, threads=threads)
    sim.step(steps)
    return sim.state_hash()


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_other_processes_compute_the_same_and_never_hang(method):
    expected = hash_after(60)  # this process has used its threads before it forks
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map_async(hash_after, [60, 60]).get(timeout=60) == [expected, expected]


def test_a_forked_child_can_go_on_with_its_parents_simulation():
    sim = cesim.Simulation(stream("50000 1/s"), seed=6, threads=2)
    sim.step(60)
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(20)  # a hang ends here
        try:
            sim.step(20)
            os.write(writer, str(sim.state_hash()).encode())
        except (RuntimeError, ValueError):
            os.write(writer, b"refused")
        os._exit(0)
    os.close(writer)
    _, status = os.waitpid(child, 0)
    answer = os.read(reader, 100).decode()
    os.close(reader)
    assert status == 0
    sim.step(20)
    assert answer in (str(sim.state_hash()), "refused")


def test_creating_and_destroying_leaks_nothing():
    def once():
        sim = cesim.Simulation(stream("100000 1/s"), threads=1)
        sim.step(20)
        return sim.landings, sim.position.sum(), sim.engine.state()

    def resident():
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 if sys.platform != "darwin" else 1024)  # kB

    for _ in range(20):
        once()
    before = resident()
    for _ in range(80):
        once()
    assert resident() - before < 3000  # one leaked state is 1 MB


def test_a_request_to_stop_that_python_loses_is_made_again_at_the_next_step():
    """An exception raised by a signal handler inside a weak reference's callback is printed and forgotten."""
    from cesim.runner import Interrupt

    with Interrupt() as interrupt:
        with contextlib.suppress(KeyboardInterrupt), interrupt.at_once():
            interrupt.handle(signal.SIGTERM, None)
        with pytest.raises(KeyboardInterrupt), interrupt.at_once():
            pass
    assert not Interrupt.running
