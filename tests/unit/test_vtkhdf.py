"""/VTKHDF of a result file: ParaView and VTK read the frames as they stand in /frames."""

from itertools import pairwise

import h5py
import numpy as np
import pytest
from streams import stream

import cesim

CASES = {
    "grains that are followed": ("20000 1/s", cesim.Frames()),
    "all grains": ("2000 1/s", cesim.Frames("5 ms", None)),
    "frames without grains": ("5 1/s", cesim.Frames("10 ms", None)),
}


@pytest.fixture(scope="module", params=CASES)
def saved(request, tmp_path_factory):
    rate, frames = CASES[request.param]
    path = tmp_path_factory.mktemp("runs") / "run.h5"
    run = cesim.run(stream(rate), seed=3, threads=1, until="0.5 s", save=path, progress=False, frames=frames)
    counts = np.diff(run.frames["offset"])
    assert request.param != "frames without grains" or np.any((counts[:-1] == 0) & (counts[1:] > 0))
    return path


def grains(group, step):
    """What a reader of VTKHDF makes of one step: points, point data, and the points of each vertex."""
    steps = group["Steps"]
    part, first = steps["PartOffsets"][step], steps["PointOffsets"][step]
    n = group["NumberOfPoints"][part]
    data = {}
    for name, column in group["PointData"].items():
        start = steps["PointDataOffsets"][name][step]
        data[name] = column[start : start + n]
    vertices = group["Vertices"]
    cell, entry = steps["CellOffsets"][step, 0], steps["ConnectivityIdOffsets"][step, 0]
    ends = vertices["Offsets"][cell : cell + vertices["NumberOfCells"][part] + 1]
    ids = vertices["Connectivity"][entry : entry + vertices["NumberOfConnectivityIds"][part]]
    return group["Points"][first : first + n], data, np.split(ids, ends[1:-1]) if n else []


def address(dataset):
    return h5py.h5o.get_info(dataset.id).addr


def test_the_columns_of_the_frames_are_linked_not_copied(saved):
    with h5py.File(saved) as file:
        group, frames = file["VTKHDF"], file["frames"]
        assert address(group["Points"]) == address(frames["position"])
        assert address(group["Steps/Values"]) == address(frames["time"])
        for name in ("id", "orientation", "velocity", "charge"):
            assert address(group["PointData"][name]) == address(frames[name])
            assert isinstance(group["PointData"].get(name, getlink=True), h5py.HardLink)
        offsets = group["Steps/PointDataOffsets"]
        names = {"id", "orientation", "velocity", "charge", "material", "diameter"}
        assert set(offsets) == set(group["PointData"]) == names
        assert {address(offsets[name]) for name in offsets} == {address(frames["offset"])}


def test_every_step_is_a_frame_and_every_grain_a_vertex(saved):
    run = cesim.open(saved)
    offset, fed = run.frames["offset"], run.particles
    with h5py.File(saved) as file:
        group = file["VTKHDF"]
        assert group.attrs["Type"] == b"PolyData"
        assert group.attrs["Version"].tolist() == [2, 0]
        assert group["Steps"].attrs["NSteps"] == len(offset) - 1 == len(run.frames["time"])
        assert group["Steps/NumberOfParts"][()].tolist() == [1] * (len(offset) - 1)
        for step, (start, end) in enumerate(pairwise(offset)):
            points, data, vertices = grains(group, step)
            assert np.array_equal(points, run.frames["position"][start:end])
            assert np.array_equal(data["charge"], run.frames["charge"][start:end])
            assert np.array_equal(data["material"], fed["material"][data["id"]])
            assert np.array_equal(data["diameter"], fed["diameter"][data["id"]].astype("f4"))
            assert [vertex.tolist() for vertex in vertices] == [[i] for i in range(end - start)]
            for kind in ("Lines", "Polygons", "Strips"):
                assert group[kind]["NumberOfCells"][step] == group[kind]["NumberOfConnectivityIds"][step] == 0


def test_a_run_without_frames_has_no_steps(tmp_path):
    cesim.run(stream(), threads=1, until="0.02 s", save=tmp_path / "run.h5", progress=False, frames=None)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == len(file["VTKHDF/NumberOfPoints"]) == 0


def test_a_run_that_was_stopped_has_the_steps_until_then(tmp_path, monkeypatch):
    step, calls = cesim.Simulation.step, []

    def stop_at_the_sixth(sim, steps):
        calls.append(steps)
        if len(calls) == 6:
            raise KeyboardInterrupt
        step(sim, steps)

    monkeypatch.setattr(cesim.Simulation, "step", stop_at_the_sixth)
    run = cesim.run(stream(), threads=1, save=tmp_path / "run.h5", progress=False)
    assert not run.complete
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == len(file["VTKHDF/NumberOfPoints"]) == 5
        assert np.array_equal(grains(file["VTKHDF"], 4)[0], run.frames["position"][run.frames["offset"][4] :])


def test_vtk_reads_what_cesim_reads(saved):
    vtk = pytest.importorskip("vtk")
    to_numpy = pytest.importorskip("vtk.util.numpy_support").vtk_to_numpy
    run = cesim.open(saved)
    frames, fed = run.frames, run.particles
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(saved))
    assert reader.CanReadFile(str(saved))
    reader.UpdateInformation()
    when = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert np.array_equal(when, frames["time"])
    for step in [*range(len(when)), *reversed(range(len(when)))]:
        reader.UpdateTimeStep(when[step])
        output, rows = reader.GetOutput(), slice(*frames["offset"][step : step + 2])
        n = rows.stop - rows.start
        assert output.GetNumberOfPoints() == output.GetNumberOfCells() == output.GetNumberOfVerts() == n
        if n:
            assert np.array_equal(to_numpy(output.GetPoints().GetData()), frames["position"][rows])
            assert to_numpy(output.GetVerts().GetConnectivityArray()).tolist() == list(range(n))
            assert to_numpy(output.GetVerts().GetOffsetsArray()).tolist() == list(range(n + 1))
            for name in ("id", "orientation", "velocity", "charge"):
                assert np.array_equal(to_numpy(output.GetPointData().GetArray(name)), frames[name][rows])
            for name in ("material", "diameter"):
                expected = fed[name][frames["id"][rows]]
                assert np.array_equal(to_numpy(output.GetPointData().GetArray(name)), expected.astype("f4"))
