"""Closed surfaces of triangles: what is refused, what is read from files, and what is not."""

import itertools
import math
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cesim import ClosedMesh, InputError
from cesim.scene import Scene, load
from cesim.shapes import polyhedra, template

CUBE = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
CUBE_FACES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]
L = polyhedra.Polyhedron(  # an L: not convex
    np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))], dtype=float),
    np.array(
        [(a, b, c) for a, b, c in ((0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4))]
        + [(a + 6, b + 6, c + 6) for a, b, c in ((0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5))]
        + [f for i in range(6) for j in [(i + 1) % 6] for f in ((i, j, j + 6), (i, j + 6, i + 6))]
    ),
)


def flipped(faces):
    return [tuple(reversed(faces[0])), *faces[1:]]


OPEN_SURFACES = {
    "open": (CUBE, CUBE_FACES[1:], "not closed"),
    "flipped": (CUBE, flipped(CUBE_FACES), "opposite"),
    "inside out": (CUBE, [f[::-1] for f in CUBE_FACES], "inside out"),
    "twice": (CUBE, CUBE_FACES * 2, "more than two"),
    "no such corner": (CUBE, [*CUBE_FACES[:-1], (1, 7, 8)], "not among"),
    "negative corner": (CUBE, [*CUBE_FACES[:-1], (1, 7, -1)], "not among"),
    "corner twice": (CUBE, [*CUBE_FACES, (1, 1, 2)], "same corner"),
    "flat": (CUBE * (1, 1, 0), CUBE_FACES, "no volume"),
    "two bodies": (
        np.concatenate([CUBE, CUBE + 5]),
        [*CUBE_FACES, *[(a + 8, b + 8, c + 8) for a, b, c in CUBE_FACES]],
        "separate",
    ),
    "too few": (CUBE, CUBE_FACES[:3], "at least 4"),
    "not finite": (np.where(CUBE == 1, np.nan, CUBE), CUBE_FACES, "finite"),
}


@pytest.mark.parametrize(("points", "faces", "reason"), OPEN_SURFACES.values(), ids=OPEN_SURFACES)
def test_surfaces_that_enclose_no_body_are_refused(points, faces, reason):
    with pytest.raises(InputError, match=reason) as caught:
        ClosedMesh(points=points, faces=faces)
    assert caught.value.path.startswith("shape.")


def test_a_surface_that_crosses_itself_is_refused():
    points = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, 3)], dtype=float)
    faces = [(0, 1, 5), (1, 2, 5), (2, 3, 5), (3, 0, 5), (1, 0, 4), (2, 1, 4), (3, 2, 4), (0, 3, 4)]
    dented = ClosedMesh(points=points, faces=faces)  # a dent is no crossing
    assert template(dented).kind == "cluster"
    points[4, 2] = 4.0
    with pytest.raises(InputError):
        template(ClosedMesh(points=points, faces=faces))
    points[4] = (2.5, 0.3, 1.0)  # the inner tip pokes out of the side
    with pytest.raises(InputError, match="crosses itself"):
        template(ClosedMesh(points=points, faces=faces))


def test_a_surface_that_winds_twice_around_its_middle_is_refused():
    turn = 4 * math.pi / 5 * np.arange(5)  # a pentagram, drawn out along z
    star = np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.vstack([np.column_stack([star, np.full(5, z)]) for z in (0.0, 1.0)])
    caps = [f for i in (1, 2, 3) for f in ((0, i + 1, i), (5, i + 5, i + 6))]
    sides = [f for i in range(5) for j in [(i + 1) % 5] for f in ((i, j, j + 5), (i, j + 5, i + 5))]
    with pytest.raises(InputError, match="more than once"):
        template(ClosedMesh(points=points, faces=[*caps, *sides]))


def test_a_body_with_a_dent_is_packed_where_it_is():
    found = template(ClosedMesh(points=L.points, faces=L.faces, spheres=40))
    assert found.shape_error < 0.35
    assert found.moments == pytest.approx(np.linalg.eigvalsh(L.mass.unit_inertia), rel=1e-9)
    # no ball in the notch
    centers = found.spheres[:, :3]
    axes = L.mass.principal_axes()
    back = centers @ axes.T * L.mass.diameter + L.mass.center
    assert not ((back[:, 0] > 1) & (back[:, 1] > 1)).any()


# ---- surfaces from files ---------------------------------------------------------------------------------------------


def binary_stl(triangles, header=b"", count=None):
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0) for t in triangles)
    return header.ljust(80, b"\0") + struct.pack("<I", len(triangles) if count is None else count) + records


def ascii_stl(triangles, number=repr):
    rows = ["solid grain"]
    for t in triangles:
        rows += ["facet normal 0 0 0", "outer loop"]
        rows += ["vertex " + " ".join(number(float(x)) for x in corner) for corner in t]
        rows += ["endloop", "endfacet"]
    return "\n".join([*rows, "endsolid grain", ""]).encode()


TRIANGLES = CUBE[np.array(CUBE_FACES)]
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in CUBE) + "".join(
    f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in CUBE_FACES
)
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 12\nproperty list uchar int vertex_indices\nend_header\n"
    + "".join(f"{x} {y} {z}\n" for x, y, z in CUBE)
    + "".join(f"3 {a} {b} {c}\n" for a, b, c in CUBE_FACES)
)
GOOD = {
    "binary.stl": binary_stl(TRIANGLES),
    "solid.stl": binary_stl(TRIANGLES, b"solid made by a program that should know better"),
    "ascii.stl": ascii_stl(TRIANGLES),
    "crlf.stl": ascii_stl(TRIANGLES).replace(b"\n", b"\r\n"),
    "CAPITALS.STL": ascii_stl(TRIANGLES).upper(),
    "degenerate.stl": binary_stl([*TRIANGLES, np.ones((3, 3))]),
    "a.obj": OBJ.encode(),
    "material.obj": b"mtllib ../../secret.mtl\nusemtl x\n" + OBJ.encode(),
    "a.ply": PLY.encode(),
}
BAD = {
    "empty.stl": b"",
    "no facets.stl": binary_stl([]),
    "no facets ascii.stl": b"solid x\nendsolid x\n",
    "truncated.stl": binary_stl(TRIANGLES)[:-30],
    "truncated ascii.stl": ascii_stl(TRIANGLES)[:-120],
    "count.stl": binary_stl(TRIANGLES, count=11),
    "huge count.stl": binary_stl(TRIANGLES, count=2**32 - 1),
    "nan.stl": binary_stl(np.where(TRIANGLES == 1, np.nan, TRIANGLES)),
    "inf.stl": binary_stl(np.where(TRIANGLES == 1, np.inf, TRIANGLES)),
    "nan ascii.stl": ascii_stl(np.where(TRIANGLES == 1, np.nan, TRIANGLES)),
    "comma.stl": ascii_stl(TRIANGLES + 0.5, lambda x: f"{x}".replace(".", ",")),
    "open.stl": binary_stl(TRIANGLES[1:]),
    "flipped.stl": binary_stl([TRIANGLES[0][::-1], *TRIANGLES[1:]]),
    "inside out.stl": binary_stl(TRIANGLES[:, ::-1]),
    "point.stl": binary_stl(np.zeros((12, 3, 3))),
    "flat.stl": binary_stl(TRIANGLES * (1, 1, 0)),
    "noise.stl": bytes(range(256)) * 20,
    "html.stl": b"<html><body>404</body></html>",
    "empty.obj": b"",
    "noise.obj": bytes(range(256)) * 20,
    "index.obj": OBJ.replace("f 1 2 4", "f 1 2 99").encode(),
    "comma.obj": OBJ.replace(".", ",").encode(),
    "nan.obj": OBJ.replace("1.0", "nan").encode(),
    "empty.ply": b"",
    "header.ply": PLY[:60].encode(),
    "truncated.ply": PLY[:-20].encode(),
    "huge.ply": PLY.replace("vertex 8", "vertex 99999999999").encode(),
    "index.ply": PLY.replace("3 0 1 3", "3 0 1 99").encode(),
    "zip.ply": b"PK\x03\x04" + bytes(200),
    "a.step": b"ISO-10303-21;",
    "a": OBJ.encode(),
}


@pytest.mark.parametrize("name", GOOD)
def test_surfaces_are_read_from_files(name, tmp_path):
    (tmp_path / name).write_bytes(GOOD[name])
    shape = ClosedMesh.read(tmp_path / name, spheres=20)
    assert len(shape.points) == 8
    assert len(shape.faces) == 12
    assert template(shape).moments == pytest.approx([1 / 6 / (6 / math.pi) ** (2 / 3)] * 3, rel=1e-6)
    assert ClosedMesh.model_validate(shape.model_dump()) == shape


@pytest.mark.parametrize("name", BAD)
def test_files_that_hold_no_closed_surface_are_refused(name, tmp_path):
    (tmp_path / name).write_bytes(BAD[name])
    with pytest.raises(InputError) as caught:
        ClosedMesh.read(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.sampled_from(sorted(GOOD)), st.integers(0, 10**9), st.integers(0, 4))
def test_damaged_files_are_read_or_refused(tmp_path, name, seed, damage):
    rng = np.random.default_rng(seed)
    content = bytearray(GOOD[name])
    if damage == 0:
        content = content[: rng.integers(len(content))]
    for _ in range(damage):
        content[rng.integers(len(content))] = rng.integers(256)
    (tmp_path / name).write_bytes(bytes(content))
    try:
        shape = ClosedMesh.read(tmp_path / name, spheres=3)
        assert np.isfinite(template(shape).moments).all()
    except InputError:
        pass


def test_files_that_are_missing_or_huge_are_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="cannot be read"):
        ClosedMesh.read(tmp_path / "missing.stl")
    with pytest.raises(InputError, match="cannot be read"):
        ClosedMesh.read("a\0b.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(InputError, match="cannot be read"):
        ClosedMesh.read(tmp_path / "folder.stl")
    (tmp_path / "a.stl").write_bytes(GOOD["binary.stl"])
    monkeypatch.setattr("cesim.shapes.surface.LARGEST_FILE", 500)
    with pytest.raises(InputError, match="larger than"):
        ClosedMesh.read(tmp_path / "a.stl")
    monkeypatch.undo()
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    with pytest.raises(InputError, match=r"cesim\[cad\]"):
        ClosedMesh.read(tmp_path / "a.stl")


@pytest.fixture
def folder(tmp_path):
    """A folder with a surface inside and one outside, and a writer of scene files."""
    inside = tmp_path / "inside"
    inside.mkdir()
    for place in (inside, tmp_path):
        (place / "grain.stl").write_bytes(GOOD["binary.stl"])
    (inside / "open.stl").write_bytes(BAD["open.stl"])
    return inside


SCENES = {
    "feed.shape": '[feed]\nrate = 1.0\nmix = {{ABS = 1.0}}\nsize = {{kind = "constant", diameter = 1e-3}}\n'
    'shape = {{kind = "mesh", file = "{}", spheres = {}}}\n',
    "feed.families[0].shape": "[feed]\nrate = 1.0\n[[feed.families]]\nmaterial = 'ABS'\nfraction = 1.0\n"
    'size = {{kind = "constant", diameter = 1e-3}}\nshape = {{kind = "mesh", file = "{}", spheres = {}}}\n',
    "shapes.mine": '[shapes.mine]\nkind = "mesh"\nfile = "{}"\nspheres = {}\n',
}


@pytest.mark.parametrize("place", SCENES)
def test_scene_files_name_surfaces_of_their_folder_only(place, folder):
    def write(name, spheres=10):
        (folder / "scene.toml").write_text(SCENES[place].format(name, spheres))
        return folder / "scene.toml"

    scene = load(write("grain.stl"))
    shape = scene.shapes.get("mine") or scene.feed.all_families()[0].shape
    assert shape == ClosedMesh.read(folder / "grain.stl", spheres=10)
    assert Scene.from_toml(scene.to_toml()) == scene  # which names no file any more
    assert load(write("../grain.stl"), allow_outside=True) == scene
    for name, spheres, where in (
        ("../grain.stl", 10, "file"),
        ("missing.stl", 10, "file"),
        ("open.stl", 10, "faces"),
        ("grain.stl", 0, "spheres"),
    ):
        with pytest.raises(InputError) as caught:
            load(write(name, spheres))
        assert caught.value.path == f"{place}.{where}"
