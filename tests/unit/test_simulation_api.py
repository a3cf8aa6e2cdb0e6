"""Simulation, run and Run: what goes in, what comes out, and that both say the same."""

import subprocess
import sys
import threading
import time

import matplotlib as mpl
import numpy as np
import pytest
from streams import stream

import cesim
from cesim import InputError


@pytest.fixture
def box():
    return cesim.Simulation(cesim.scenes.settling_box(), threads=1)


@pytest.fixture(scope="module")
def run():
    return cesim.run(stream(), seed=5, threads=1, until="0.5 s", progress=False)


# ---- Simulation ------------------------------------------------------------------------------------------------------


def test_grains_are_added_with_defaults_and_broadcasting(box):
    assert box.add([0, 0.01, 0]).tolist() == [0]
    ids = box.add([[0, 0.02, 0], [0, 0.03, 0]], velocity=[0, -1, 0], material="ABS", diameter=2e-3, charge=[1e-12, 0])
    assert ids.tolist() == [1, 2]
    assert box.count == 3
    assert box.ids.tolist() == [0, 1, 2]
    assert box.velocity.tolist() == [[0, 0, 0], [0, -1, 0], [0, -1, 0]]
    assert [box.material_names[m] for m in box.material] == ["copper", "ABS", "ABS"]
    assert box.diameter.tolist() == [1e-3, 2e-3, 2e-3]
    assert box.charge.tolist() == [0, 1e-12, 0]
    assert box.mass == pytest.approx(np.pi / 6 * box.diameter**3 * np.array([8960, 1050, 1050]))
    assert box.orientation.tolist() == [[1, 0, 0, 0]] * 3
    assert box.add(np.empty((0, 3))).tolist() == []


def test_materials_may_be_names_indices_or_a_list_of_both(box):
    box.add(np.array([[0.0, y, 0] for y in (0.01, 0.02, 0.03)]), material=["PE", 0, np.int64(1)])
    assert [box.material_names[m] for m in box.material] == ["PE", box.material_names[0], box.material_names[1]]
    box.add([0, 0.04, 0], shape=cesim.Sphere(), angular_velocity=[1, 2, 3])
    assert box.angular_velocity[-1].tolist() == [1, 2, 3]


@pytest.mark.parametrize("dtype", ["f4", ">f8", "i8", "u2", "f2", "longdouble"])
def test_any_real_dtype_and_layout_is_taken(box, dtype):
    wide = np.zeros((4, 6), dtype)
    wide[:, ::2] = [[0, 0.25, 0], [0, 0.5, 0], [0, 0.75, 0], [0, 1, 0]]
    position = wide[::2, ::2]
    position.setflags(write=False)
    box.add(position)
    assert np.array_equal(box.position, position.astype(float))


def test_what_was_added_is_a_copy(box):
    position, diameter = np.array([[0.0, 0.02, 0.0]]), np.array([1e-3])
    box.add(position, diameter=diameter)
    position[:], diameter[:] = 9, 9
    assert box.position.tolist() == [[0, 0.02, 0]]
    assert box.diameter.tolist() == [1e-3]


def test_columns_are_views_that_can_be_written_and_never_dangle(box):
    box.add([0, 0.02, 0])
    box.velocity[0] = [0.1, 0, 0]
    assert box.velocity[0, 0] == 0.1
    for name in ("mass", "diameter", "material", "ids"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(box, name)[0] = 1
    old = box.position
    box.add(np.column_stack([np.zeros(5000), np.linspace(0.03, 0.9, 5000), np.zeros(5000)]), diameter=1e-4)
    box.step(3)
    del box
    assert np.isfinite(old).all()


def test_time_steps_and_until(box):
    box.add([0, 0.3, 0])
    box.step()
    assert box.time == box.step_size == 1e-3
    box.step(np.int16(9))
    box.run("0.0125 s")
    assert box.time == pytest.approx(0.013)
    box.run(0.005)
    assert box.time == pytest.approx(0.013)
    box.run("20 ms")
    assert box.time == pytest.approx(0.020)


def test_the_scene_is_copied():
    scene = stream()
    sim = cesim.Simulation(scene, threads=1)
    scene.feed = None
    sim.step(20)
    assert sim.balance.fed.count > 300
    assert sim.scene.feed is not None


def test_landings_and_balance_agree():
    sim = cesim.Simulation(stream(), seed=2, threads=1)
    sim.run("0.3 s")
    landings, balance = sim.landings, sim.balance
    assert {"id", "material", "t", "position", "velocity", "charge", "mass", "diameter"} <= set(landings.dtype.names)
    assert len(landings) == balance.landed.count > 1000
    assert balance.fed.count == balance.landed.count + balance.resident.count + balance.lost.count
    assert balance.fed.kg == pytest.approx(balance.landed.kg + balance.resident.kg + balance.lost.kg, rel=1e-15)
    assert balance.closed
    assert np.allclose(landings["position"][:, 1], 0.0, atol=1e-12)
    assert (np.diff(landings["t"]) >= -sim.step_size).all()
    assert "landed" in str(balance)


def test_what_leaves_the_bounds_is_lost_and_not_landed():
    sim = cesim.Simulation(stream(), threads=1)
    sim.add([0.5, 0.4, 0], velocity=[50, 0, 0])
    sim.run("0.05 s")
    assert sim.lost["id"].tolist() == [0]
    assert 0 not in sim.landings["id"]
    assert sim.balance.lost.count == 1


def test_contacts_name_grains_and_surfaces(box):
    box.add([[0, 0.001, 0], [0, 0.003, 0]], diameter=2e-3)
    box.step(20)
    contacts = box.contacts
    floor = contacts[contacts["b"] < 0]
    assert box.surface_names[-1 - floor["b"][0]] == "walls[0]"
    pair = contacts[contacts["b"] >= 0]
    assert {int(pair["a"][0]), int(pair["b"][0])} == {0, 1}
    weight = box.mass.sum() * 9.81 * box.step_size
    assert floor["impulse"][0] == pytest.approx([0, weight, 0], abs=0.02 * weight)
    health = box.health
    assert health.contacts == 2
    assert health.converged
    assert health.steps == 20
    assert health.residual < 1e-3
    assert health.seconds["solve"] > 0
    assert "converged" in str(health)


def test_seeds_and_threads():
    def state(seed, threads):
        sim = cesim.Simulation(stream(), seed=seed, threads=threads)
        sim.step(60)
        assert sim.threads == threads
        return sim.state_hash()

    assert state(1, 1) == state(1, 2) == state(1, 3)
    assert state(1, 1) != state(2, 1)
    assert state(2**64 - 1, 1) != state(0, 1)


def test_a_second_thread_that_steps_is_told_so():
    sim = cesim.Simulation(stream("200000 1/s"), threads=1)
    told = []

    def disturb():
        while not told and thread.is_alive():
            try:
                sim.step()
            except RuntimeError as error:
                told.append(str(error))

    thread = threading.Thread(target=lambda: step_until_told(sim, told))
    thread.start()
    disturb()
    thread.join()
    assert "another thread" in told[0]


def step_until_told(sim, told):
    end = time.monotonic() + 20
    while not told and time.monotonic() < end:
        try:
            sim.step(20)
        except RuntimeError as error:
            told.append(str(error))


# ---- run and Run -----------------------------------------------------------------------------------------------------


def test_grade_and_recovery_are_those_of_the_landings(run):
    rows, names = run.landings, run.material_names
    left, right = 0.0, 0.03
    x, mass, copper = rows["position"][:, 0], rows["mass"], rows["material"] == names.index("copper")
    assert run.recovery("copper") == pytest.approx(mass[copper & (x >= right)].sum() / mass[copper].sum(), rel=1e-9)
    assert run.grade("copper") == pytest.approx(mass[copper & (x >= right)].sum() / mass[x >= right].sum(), rel=1e-9)
    assert run.recovery("ABS") == pytest.approx(mass[~copper & (x < left)].sum() / mass[~copper].sum(), rel=1e-9)
    assert run.middlings() == pytest.approx(mass[(x >= left) & (x < right)].sum() / mass.sum(), rel=1e-9)
    assert run.recovery("copper", ("0 mm", "30 mm")) == run.recovery("copper")
    assert run.recovery("copper", (0.05, 0.08), datum="50 mm") == run.recovery("copper", (0.1, 0.13))
    assert run.recovery("copper", "10 mm", product="insulator") + run.recovery("copper", "10 mm") == pytest.approx(1)
    everything = sum(run.recovery("copper", product=p) for p in ("insulator", "middling", "conductor"))
    assert everything == pytest.approx(1)
    estimate = run.recovery("copper")
    assert estimate.low < estimate < estimate.high
    assert estimate.n_eff <= np.count_nonzero(copper)


def test_warmup_leaves_out_what_landed_before(run):
    sample = run.sample("0.2 s")
    assert sample.time.min() >= 0.2
    assert 0 < len(sample.time) < len(run.landings)
    assert run.bins(10, warmup="0.2 s").count["copper"].sum() < run.bins(10).count["copper"].sum()


def test_bins_add_up_to_the_balance_exactly(run):
    bins = run.bins(60, x=("-50 mm", "50 mm"), datum="5 mm")
    assert set(bins.mass) == {"copper", "ABS"}
    assert sum(m.sum() + bins.underflow[n] + bins.overflow[n] for n, m in bins.mass.items()) == run.balance.landed.kg
    assert len(bins.edges) == 61
    assert len(run.bins().edges) == 41
    assert run.bins(by=None).mass["all"].sum() == pytest.approx(sum(m.sum() for m in run.bins().mass.values()))


def test_splitter_pairs_agree_with_single_ones(run):
    table = run.splitters(21, x=("-50 mm", "50 mm"))
    i, j = 9, 14
    pair = (table.positions[i], table.positions[j])
    assert table.recovery["copper"][i, j] == run.recovery("copper", pair)
    assert table.grade["ABS"][i, j] == run.grade("ABS", pair)
    assert table.middling[i, j] == run.middlings(pair)


def test_landings_as_a_frame(run):
    frame = run.landings_frame()
    assert len(frame) == len(run.landings)
    assert set(frame["material"]) == {"copper", "ABS"}
    assert set(frame["surface"]) == {"none"}
    assert np.array_equal(frame["x"], run.landings["position"][:, 0])


def test_the_page_says_what_matters(run):
    page = str(run)
    for word in ("copper", "ABS", "recovery", "middlings", "balance", "residual", "penetration", "time a step", "["):
        assert word in page
    assert max(map(len, page.splitlines())) <= 120
    assert "0.5 s" in page
    assert repr(run).startswith("<cesim.Run of 'stream', seed 5")


def test_trajectories_end_where_the_grain_landed(run):
    paths = run.trajectories()
    landed = {int(row["id"]): row for row in run.landings}
    complete = [i for i in paths if i in landed]
    assert len(complete) > 50
    for i in complete:
        times, positions = paths[i]
        assert (np.diff(times) > 0).all()
        assert positions[-1] == pytest.approx(landed[i]["position"], abs=1e-6)
    assert run.materials_of(np.array(complete[:3])) == [run.material_names[landed[i]["material"]] for i in complete[:3]]
    assert np.diff(run.frames["offset"]).max() <= 64


def test_fed_counts_grains():
    run = cesim.run(stream(), threads=1, until=cesim.Fed(1000), progress=False)
    assert 1000 <= run.balance.fed.count < 1400
    with pytest.raises(InputError, match="no feed"):
        cesim.run(cesim.scenes.single_particle(), until=cesim.Fed(10))
    with pytest.raises(InputError, match="count"):
        cesim.Fed(0)


def test_a_run_without_landings_says_so():
    run = cesim.run(stream(), threads=1, until="0.01 s", progress=False)
    assert "nothing has landed" in str(run)
    assert np.isnan(run.grade("copper"))
    assert run.bins().mass["copper"].sum() == 0
    run.plot()


def test_a_scene_without_splitters_or_plane_needs_positions():
    scene = stream()
    scene.collect.splitters = None
    run = cesim.run(scene, threads=1, until="0.3 s", progress=False)
    with pytest.raises(InputError, match="splitters"):
        run.grade("copper")
    assert run.grade("copper", (0.0, 0.03)) > 0
    assert "landed" in str(run)
    empty = cesim.run(cesim.scenes.settling_box(), threads=1, until="0.01 s", progress=False)
    with pytest.raises(InputError, match="landing plane"):
        empty.bins()
    str(empty)
    empty.plot()


def test_pictures_are_drawn(run, tmp_path):
    figure = run.plot(tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 20_000
    top, bottom = figure.axes
    assert "[mm]" in top.get_ylabel()
    assert "[mm]" in bottom.get_xlabel()
    assert "[g]" in bottom.get_ylabel()
    assert top.get_xlim() == bottom.get_xlim()
    ax = run.bins().plot(splitters=("0 mm", 0.03))
    assert len(ax.lines) == 2
    with pytest.raises(InputError, match="cannot be written"):
        run.plot(tmp_path / "no" / "run.png")
    mpl.pyplot.close("all")


def test_what_to_cite_follows_what_was_used(run):
    lines = cesim.cite(run)
    assert any("Critelli" in line for line in lines)
    assert any("Schiller" in line for line in lines)
    assert not any("two cylinders" in line for line in lines)
    machine = cesim.scenes.reference_machine("spheres")
    machine.numerics.contact_law = "ccp"
    from cesim.citations import citations

    assert any("two cylinders" in line for line in citations(machine.definition()))


def test_importing_cesim_is_light():
    heavy = ("matplotlib", "pandas", "pint", "h5py", "scipy", "tqdm", "pydantic")
    code = f"import sys, cesim; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    for name in cesim.__all__:
        assert getattr(cesim, name) is not None
    with pytest.raises(AttributeError, match="no attribute"):
        cesim.nonsense  # noqa: B018
