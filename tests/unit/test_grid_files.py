"""Files with a potential or a field on a grid: every format, and what is refused."""

import base64
import struct
import zlib

import h5py
import numpy as np
import pytest
from scenes import assert_goes_on_bit_for_bit

import cesim
from cesim import InputError
from cesim.fields import Grid
from cesim.fields.stored import StoredArray
from cesim.scene import GridField, Scene

X, Y, Z = np.linspace(-0.1, 0.2, 7), np.linspace(0.0, 0.25, 6), np.linspace(-0.2, 0.2, 5)


def potential(x, y, z=0.0):
    return 1e3 * (x**2 - y**2 + 2.0 * x * y + 0.5 * z * x + 0.3)


def field(x, y, z=0.0):
    return -1e3 * np.stack(np.broadcast_arrays(2 * x + 2 * y + 0.5 * z, -2 * y + 2 * x, 0.5 * x + 0.0 * z))


FLAT = np.meshgrid(X, Y, indexing="ij")
SOLID = np.meshgrid(X, Y, Z, indexing="ij")
POINTS = np.random.default_rng(1).uniform((-0.1, 0.0, -0.2), (0.2, 0.25, 0.2), (50, 3))


def is_right(grid, solid=False):
    at = POINTS if solid else POINTS * [1, 1, 0]
    assert grid(at) == pytest.approx(field(*at.T).T * [1, 1, solid], abs=1e-6)


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def comsol(columns, names, unit="m"):
    head = f"% Model,separator.mph\n% Version,COMSOL 6.1.0.252\n% Dimension,2\n% Nodes,42\n% Length unit,{unit}\n"
    return head + "% " + names + "\n" + "\n".join(",".join(f"{v:.17g}" for v in row) for row in np.stack(columns, 1))


# ---- what is read ----------------------------------------------------------------------------------------------------


def test_a_comsol_table_of_potentials_in_millimetres_and_any_order(tmp_path):
    order = np.random.default_rng(2).permutation(42)
    columns = [(1e3 * a.ravel())[order] for a in FLAT] + [(1e-3 * potential(*FLAT).ravel())[order]]
    grid = Grid.read(write(tmp_path / "v.csv", comsol(columns, "x,y,V (kV)", "mm")))
    is_right(grid)
    assert grid.curl_residual == 0.0
    assert grid.potential(POINTS * [1, 1, 0]) == pytest.approx(potential(*(POINTS * [1, 1, 0]).T), abs=1e-9)


def test_a_comsol_table_of_field_components_gives_its_potential_back(tmp_path):
    columns = [a.ravel() for a in FLAT] + [a.ravel() for a in field(*FLAT)[:2]]
    grid = Grid.read(write(tmp_path / "e.txt", comsol(columns, "x,y,es.Ex (V/m),es.Ey (V/m)")))
    is_right(grid)
    assert grid.curl_residual < 1e-12


def test_a_table_with_columns_of_blanks_in_three_dimensions(tmp_path):
    text = "% x                y              z             V (V)\n"
    text += "\n".join(
        "  ".join(f"{v:.17g}" for v in row) for row in np.stack([*map(np.ravel, SOLID), potential(*SOLID).ravel()], 1)
    )
    is_right(Grid.read(write(tmp_path / "v.txt", text)), solid=True)


def test_a_table_without_percent_signs(tmp_path):
    rows = np.stack([*map(np.ravel, FLAT), potential(*FLAT).ravel()], 1)
    is_right(
        Grid.read(write(tmp_path / "v.csv", "x,y,V\n" + "\n".join(",".join(map(repr, row.tolist())) for row in rows)))
    )


def test_uneven_nodes_are_made_even(tmp_path):
    x = np.array([-0.1, -0.05, -0.02, 0.0, 0.05, 0.12, 0.2])
    flat = np.meshgrid(x, Y, indexing="ij")
    grid = Grid.read(write(tmp_path / "v.csv", comsol([*map(np.ravel, flat), potential(*flat).ravel()], "x,y,V (V)")))
    assert grid.values.shape[0] == 16
    is_right(grid)


@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("components", [False, True])
@pytest.mark.parametrize("axes", [False, True])
def test_hdf5_with_axes_or_origin_and_with_a_potential_or_components(tmp_path, solid, components, axes):
    nodes = SOLID if solid else FLAT
    with h5py.File(tmp_path / "v.h5", "w") as file:
        if axes:
            file["x"], file["y"] = X, Y
            if solid:
                file["z"] = Z
        else:
            file["origin"] = [-0.1, 0.0, -0.2][: 2 + solid]
            file["spacing"] = [0.05, 0.05, 0.1][: 2 + solid]
        if components:
            for name, values in zip(("Ex", "Ey", "Ez")[: 2 + solid], field(*nodes), strict=False):
                file[name] = values
        else:
            file["V"] = potential(*nodes)
    is_right(Grid.read(tmp_path / "v.h5"), solid)


def vti(data, form, extra="", tail=""):
    return (
        f'<?xml version="1.0"?><VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" '
        f'header_type="UInt32"{extra}><ImageData WholeExtent="0 6 0 5 0 4" Origin="-0.1 0 -0.2" '
        f'Spacing="0.05 0.05 0.1"><Piece Extent="0 6 0 5 0 4"><PointData><DataArray type="Float64" Name="V" '
        f"{form}>{data}</DataArray></PointData></Piece></ImageData>{tail}</VTKFile>"
    ).encode()


def vtk_files():
    values = np.ascontiguousarray(potential(*SOLID).transpose(2, 1, 0)).astype("<f8")
    raw = values.tobytes()
    head = struct.pack("<I", len(raw))
    packed = zlib.compress(raw)
    blocks = struct.pack("<4I", 1, len(raw), 0, len(packed))
    text = " ".join(map(repr, values.ravel().tolist()))
    compressor = ' compressor="vtkZLibDataCompressor"'
    encoded = base64.b64encode(blocks).decode() + base64.b64encode(packed).decode()
    whole = base64.b64encode(head + raw).decode()
    appended = '<AppendedData encoding="raw">_@@@</AppendedData>'
    legacy = (
        "# vtk DataFile Version 3.0\ntitle\n{}\nDATASET {}\nDIMENSIONS 7 6 5\n{}POINT_DATA 210\nSCALARS V double 1\n"
    )
    legacy += "LOOKUP_TABLE default\n"
    image = "ORIGIN -0.1 0 -0.2\nSPACING 0.05 0.05 0.1\n"
    lines = "".join(
        f"{name}_COORDINATES {len(axis)} double\n{' '.join(map(repr, axis.tolist()))}\n"
        for name, axis in zip("XYZ", (X, Y, Z), strict=True)
    )
    coordinates = "".join(
        f'<DataArray type="Float64" format="ascii">{" ".join(map(str, a))}</DataArray>' for a in (X, Y, Z)
    )
    yield "ascii.vti", vti(text, 'format="ascii"')
    yield "binary.vti", vti(whole, 'format="binary"')
    yield "packed.vti", vti(encoded, 'format="binary"', compressor)
    yield "raw.vti", vti("", 'format="appended" offset="0"', tail=appended).replace(b"@@@", head + raw)
    yield (
        "packed_raw.vti",
        vti("", 'format="appended" offset="0"', compressor, appended).replace(b"@@@", blocks + packed),
    )
    yield "text.vtk", (legacy.format("ASCII", "STRUCTURED_POINTS", image) + text).encode()
    yield "binary.vtk", legacy.format("BINARY", "STRUCTURED_POINTS", image).encode() + values.astype(">f8").tobytes()
    yield "lines.vtk", (legacy.format("ASCII", "RECTILINEAR_GRID", lines) + text).encode()
    yield (
        "lines.vtr",
        vti(text, 'format="ascii"')
        .replace(b"ImageData", b"RectilinearGrid")
        .replace(b"</PointData>", b"</PointData><Coordinates>" + coordinates.encode() + b"</Coordinates>"),
    )


@pytest.mark.parametrize(("name", "content"), list(vtk_files()), ids=[name for name, _ in vtk_files()])
def test_vtk_in_every_encoding(tmp_path, name, content):
    is_right(Grid.read(write(tmp_path / name, content)), solid=True)


def test_a_field_with_curl_says_how_much_of_it_no_potential_explains(tmp_path):
    x, y = FLAT
    columns = [x.ravel(), y.ravel(), (-1e3 * (y - 0.125)).ravel(), (1e3 * (x - 0.05)).ravel()]
    grid = Grid.read(write(tmp_path / "e.csv", comsol(columns, "x,y,Ex (V/m),Ey (V/m)")))
    assert grid.curl_residual > 0.3


# ---- what is refused -------------------------------------------------------------------------------------------------

TABLE = [a.ravel() for a in FLAT] + [potential(*FLAT).ravel()]
HOLE = [*TABLE[:2], np.where(np.arange(42) == 17, np.nan, TABLE[2])]


def hdf5(**sets):
    def content(path):
        with h5py.File(path, "w") as file:
            for name, value in sets.items():
                if isinstance(value, tuple):
                    file.create_dataset(name, value, "f8", chunks=(100,) * len(value))
                else:
                    file[name] = value

    return content


def truncated(path):
    hdf5(x=X, y=Y, V=potential(*FLAT))(path)
    path.write_bytes(path.read_bytes()[:1000])


BAD = {
    "a number is missing": ("v.csv", comsol(HOLE, "x,y,V (V)"), "1 nodes without a finite number"),
    "no potential": ("v.csv", comsol(TABLE, "x,y,T (K)"), "T in 'K'|t in 'K'"),
    "other quantity": ("v.csv", comsol(TABLE, "x,y,q"), "has q, must have V, or Ex, Ey"),
    "no names": ("v.csv", "1,2,3\n4,5,6\n", "no line that names its columns"),
    "one component": ("v.csv", comsol(TABLE, "x,y,Ex (V/m)"), "must have V, or Ex, Ey"),
    "too few columns": ("v.csv", comsol(TABLE, "x,y,Ex,Ey"), "names 4 columns and has 3"),
    "no grid": ("v.csv", comsol([np.cumsum(TABLE[0] + 0.2), TABLE[1], TABLE[2]], "x,y,V"), "are no grid of"),
    "a point twice": ("v.csv", comsol([np.append(a, a[0]) for a in TABLE], "x,y,V"), "43 points, which are no grid"),
    "words": ("v.csv", "% x,y,V\n1,2,three\n", "no row of numbers"),
    "too few nodes": ("v.csv", comsol([a[:18] for a in TABLE], "x,y,V"), "3 nodes along x"),
    "inches": ("v.csv", comsol(TABLE, "x,y,V", "in"), "lengths in 'in'"),
    "binary": ("v.csv", b"\xff\xfe\x00\x01", "is not text"),
    "truncated": ("v.h5", truncated, "cannot be read"),
    "huge": ("v.h5", hdf5(x=X, y=Y, V=(10**5, 10**5)), "1e10 numbers in 'V', at most"),
    "no axes": ("v.h5", hdf5(V=potential(*FLAT)), "must have x and y, or origin and spacing"),
    "text": ("v.h5", hdf5(x=X, y=Y, V="high"), "must be numbers"),
    "other shape": ("v.h5", hdf5(x=X, y=X, V=potential(*FLAT)), r"shape \(7, 6, 1\) on nodes of shape \(7, 7, 1\)"),
    "falling axis": ("v.h5", hdf5(x=X[::-1], y=Y, V=potential(*FLAT)), "along x that do not ascend"),
    "huge image": ("v.vti", vti("", 'format="ascii"').replace(b"0 6", b"0 999999999"), "at most 50000000 may be"),
    "entities": ("v.vti", b'<!DOCTYPE a [<!ENTITY b "c">]><VTKFile/>', "entities"),
    "short image": ("v.vti", vti("1 2 3", 'format="ascii"'), "3 numbers in 'V', must be 210"),
    "damaged": ("v.vti", vti("????", 'format="binary"'), "damaged|buffer|numbers"),
    "no legacy": ("v.vtk", b"hello", "does not begin"),
    "cut legacy": ("v.vtk", dict(vtk_files())["binary.vtk"][:-9], "ends within an array"),
    "unknown": ("v.xlsx", b"", "must end in .h5"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_with_its_name_and_what_is_wrong(tmp_path, case):
    name, content, words = BAD[case]
    if callable(content):
        content(tmp_path / name)
    else:
        write(tmp_path / name, content)
    with pytest.raises(InputError, match=words) as info:
        Grid.read(tmp_path / name)
    assert info.value.path == "file"
    assert name in str(info.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        Grid.read(tmp_path / "v.csv")


def test_a_link_in_hdf5_is_not_followed(tmp_path):
    hdf5(x=X, y=Y, V=potential(*FLAT))(tmp_path / "other.h5")
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file["x"], file["y"] = X, Y
        file["V"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "V")
    with pytest.raises(InputError, match="no data set of its own"):
        Grid.read(tmp_path / "v.h5")


# ---- in a scene ------------------------------------------------------------------------------------------------------


@pytest.fixture
def grid():
    return Grid((-0.1, 0.0), (0.05, 0.05), potential(*FLAT), source="by hand")


def test_an_array_survives_its_text_bit_for_bit():
    values = np.random.default_rng(3).normal(size=(5, 6, 7)) * 10.0 ** np.arange(-3, 4)
    again = StoredArray.read(StoredArray(values).text())
    assert np.array_equal(again.values, values)
    assert again == StoredArray(values) != StoredArray(values + 1.0)


@pytest.mark.parametrize(
    "text", ["", "f8 1 1 1 !", "f8 4 4 4 AAAA", "f8 99999 99999 1 AAAA", "f8 1 1 1 eJxjYGBgAAAABAAB"]
)
def test_the_text_of_no_array_is_refused(text):
    with pytest.raises(InputError, match="array"):
        StoredArray.read(text)


def test_a_scene_with_a_grid_survives_its_text_form(grid):
    scene = Scene(field=grid)
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.electric_field().potential(POINTS) == pytest.approx(grid.potential(POINTS), abs=0)


def test_a_scene_file_names_a_grid_beside_it(tmp_path):
    write(tmp_path / "v.csv", comsol(TABLE, "x,y,V (V)"))
    write(tmp_path / "scene.toml", 'cesim = 1\n[field]\nkind = "grid"\nfile = "v.csv"\n')
    scene = cesim.load(tmp_path / "scene.toml")
    assert isinstance(scene.field, GridField)
    is_right(scene.electric_field())
    write(tmp_path / "far.toml", 'cesim = 1\n[field]\nkind = "grid"\nfile = "/v.csv"\n')
    with pytest.raises(InputError, match=r"^field.file is '/v.csv', outside the scene's folder"):
        cesim.load(tmp_path / "far.toml")
    write(tmp_path / "v.csv", "x,y,V\n")
    with pytest.raises(InputError, match=r"^field.file 'v.csv' "):
        cesim.load(tmp_path / "scene.toml")
    with pytest.raises(InputError, match=r"^field.file names a file"):
        Scene.from_toml('[field]\nkind = "grid"\nfile = "v.csv"\n')


def test_a_run_stores_its_grid_and_goes_on_without_the_file(tmp_path):
    flat = np.meshgrid(np.linspace(-0.1, 0.2, 13), np.linspace(0.0, 0.25, 11), indexing="ij")
    columns = [*map(np.ravel, flat), np.exp(5.0 * flat[0] + flat[1]).ravel()]
    path = write(tmp_path / "v.csv", comsol(columns, "x,y,V (kV)"))
    scene = cesim.scenes.single_particle()
    scene.electrode, scene.field = None, {"kind": "grid", "file": str(path)}
    scene.effects["electric_force"] = "on"
    path.unlink()
    assert_goes_on_bit_for_bit(scene, [[0.0, 0.17, 0.0], [0.03, 0.18, 0.05]], 1e-10, tmp_path / "restart.h5")

    scene.feed = cesim.scenes.reference_machine("spheres").feed
    run = cesim.run(scene, until="0.01 s", save=tmp_path / "run.h5", progress=False)
    stored = Grid.read(tmp_path / "run.h5")
    assert np.array_equal(stored.values, scene.field.values.values)
    assert "interpolation error" in str(run)
    assert run.definition["field"]["source"] == "v.csv"
    assert np.isfinite(run.definition["field"]["interpolation_error"])


def test_a_field_gives_its_memory_back():
    """A grid of 3 MB, made a hundred times."""
    resource = pytest.importorskip("resource", reason="Windows does not tell the peak of memory")
    scene = Scene(field=Grid((0.0, 0.0), (1e-3, 1e-3), np.zeros((600, 600)), interpolation_error=0.0))
    definition = scene.definition()
    peaks = []
    for _ in range(2):
        for _ in range(50):
            cesim.engine.Field(definition["field"])
            cesim.engine.Scene(definition)
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert peaks[1] - peaks[0] < 100_000  # kB; 300 MB were it kept
