"""Triangle meshes: distances, the search tree, the contacts of a sphere's path, and the files they come from."""

import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import box, distances, scattered_sheet, sheet, soup, tube

import cesim
from cesim import engine
from cesim.scene.mesh import flaws, read_mesh, seams

STILL = np.zeros((1, 3))


def contacts(shape, center, path=None, radius=0.1, margin=0.0, restitution=0.0):
    center = np.atleast_2d(center).astype(float)
    path = np.zeros_like(center) if path is None else np.atleast_2d(path).astype(float)
    return engine.mesh_contacts(*shape, center, path, radius, margin, restitution)


# ---- geometry --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 4, 5, 9, 300])
def test_the_distance_is_that_of_brute_force(count):
    rng = np.random.default_rng(count)
    vertices, triangles = soup(rng, count)
    points = rng.uniform(-2.0, 2.0, (400, 3))
    want = distances(vertices, triangles, points).min(axis=1)
    assert np.abs(engine.mesh_distance(vertices, triangles, points) - want).max() < 1e-14


@pytest.mark.parametrize("count", [1, 4, 5, 9, 300, 3000])
def test_the_tree_finds_what_brute_force_finds(count):
    rng = np.random.default_rng(count)
    vertices, triangles = soup(rng, count)
    least, most = vertices[triangles].min(axis=1), vertices[triangles].max(axis=1)
    found = 0
    for _ in range(100):
        lower = rng.uniform(-1.5, 1.5, 3)
        upper = lower + rng.uniform(0.0, 0.5, 3)
        want = np.flatnonzero(((least <= upper) & (most >= lower)).all(axis=1))
        assert engine.mesh_query(vertices, triangles, tuple(lower), tuple(upper)) == want.tolist()
        found += len(want)
    assert found > 0


def test_the_tree_stands_equal_centres():
    """A thousand triangles about one point: the median splits them by their number."""
    vertices, triangles = soup(np.random.default_rng(1), 1)
    many = np.repeat(triangles, 1000, axis=0)
    assert engine.mesh_query(vertices, many, (-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)) == list(range(1000))


def test_a_sphere_outside_of_a_box_makes_the_one_contact_that_a_box_has():
    """Faces, edges and corners; hidden faces behind the front, and seams inside a face, make none."""
    rng = np.random.default_rng(2)
    edges = np.array([1.0, 0.6, 0.4])
    shape = box(tuple(edges))
    points = rng.uniform(-1.0, 1.0, (3000, 3))
    outside = np.maximum(np.abs(points) - 0.5 * edges, 0.0)
    distance = np.linalg.norm(outside, axis=1)
    points, outside, distance = (x[distance > 0.0] for x in (points, outside, distance))
    found = contacts(shape, points, radius=0.01, margin=10.0)
    first = np.flatnonzero(np.diff(found["sphere"], prepend=-1))
    nearest = found[first]
    assert len(nearest) == len(points)
    assert np.array_equal(np.bincount(found["sphere"]), np.ones(len(points)))
    assert np.abs(nearest["gap"] + 0.01 - distance).max() < 1e-14
    assert np.abs(nearest["normal"] - np.copysign(outside, points) / distance[:, None]).max() < 1e-12
    assert np.array_equal(nearest["feature"], (outside > 0.0).sum(axis=1) - 1)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("make", [lambda: sheet(40, 1.0), lambda: scattered_sheet(500, 1.0)])
def test_a_path_onto_a_flat_sheet_meets_its_plane_wherever_the_seams_are(make, side):
    rng = np.random.default_rng(3)
    radius, n = 2e-3, 5000
    center = np.column_stack(
        [rng.uniform(-0.3, 0.3, n), side * rng.uniform(1.0, 3.0, n) * radius, rng.uniform(-0.3, 0.3, n)]
    )
    center[:100, 1] = side * radius  # on it
    center[100:200, 1] = side * 0.9 * radius  # in it
    path = rng.normal(0.0, 5e-3, (n, 3))
    found = contacts(make(), center, path, radius)
    hits = side * (center + path)[:, 1] < radius
    hits[:200] = True
    assert np.array_equal(np.unique(found["sphere"]), np.flatnonzero(hits))
    assert len(found) == hits.sum()  # one each
    mine = found["sphere"]
    assert np.array_equal(found["normal"], np.tile([0.0, side, 0.0], (len(found), 1)))
    assert np.abs(found["plane_gap"] - (np.abs(center[mine, 1]) - radius)).max() < 1e-15
    deep = np.clip((radius - side * center[mine, 1]) / (side * path[mine, 1]), 0.0, None)
    later = found["plane_gap"] > 1e-6 * radius
    assert np.abs(found["fraction"] - deep)[later].max() < 1e-6


def test_a_corner_on_the_middle_of_an_edge_is_no_seam():
    """Neighbours that share no corners, as in files without welding, and a T: two triangles along the edge of one."""
    big = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    left = [[-1.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 1.0]]
    right = [[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    shape = np.array([big, left, right]).reshape(-1, 3), np.arange(9, dtype=np.uint32).reshape(-1, 3)
    radius = 0.05
    for x in np.linspace(-0.05, 0.3, 60):
        found = contacts(shape, [x, radius, -0.02], [0.0, -1e-4, 0.05], radius, margin=0.1 * radius)
        assert np.array_equal(found["normal"], [[0.0, 1.0, 0.0]])


def test_in_a_valley_both_faces_count_and_its_edge_does_not():
    slope = np.radians(30.0)
    ridge = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    wings = [[[s * np.cos(slope), np.sin(slope), z] for z in (-1.0, 1.0)] for s in (-1.0, 1.0)]
    vertices = np.concatenate([ridge, *wings])
    shape = vertices, np.array([[0, 1, 2], [1, 3, 2], [0, 1, 4], [1, 5, 4]], dtype=np.uint32)
    radius = 0.1
    above = contacts(shape, [0.0, radius / np.cos(slope), 0.1], [0.0, -0.05, 0.03], radius)
    assert sorted(above["feature"]) == [0, 0]
    assert np.allclose(sorted(above["normal"][:, 0]), [-np.sin(slope), np.sin(slope)])
    below = contacts(shape, [0.0, -1.001 * radius, 0.1], [0.0, 0.05, 0.03], radius)
    assert below["feature"].tolist() == [1]  # from below it is a ridge
    assert np.allclose(below["normal"], [[0.0, -1.0, 0.0]])


def test_what_lies_behind_a_face_is_not_met():
    """The free path goes through the floor and would hit a wall in the cellar."""
    floor = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 2.0]]
    cellar = [[0.2, -0.1, -1.0], [0.2, -0.1, 1.0], [0.2, -1.0, 0.0]]
    shape = np.array([floor, cellar]).reshape(-1, 3), np.arange(6, dtype=np.uint32).reshape(-1, 3)
    found = contacts(shape, [0.0, 0.05, 0.0], [0.5, -0.5, 0.0], 0.02)
    assert found["triangle"].tolist() == [0]
    alone = shape[0], shape[1][1:]
    assert contacts(alone, [0.0, 0.05, 0.0], [0.5, -0.5, 0.0], 0.02)["hit"].tolist() == [1]


def test_a_wall_behind_the_first_hit_is_met_on_the_way_that_is_left():
    """The free path goes through the floor in front of a wall that stands on it, and under the wall."""
    floor = [[-1.0, 0.0, -1.0], [0.3, 0.0, -1.0], [0.3, 0.0, 1.0], [-1.0, 0.0, 1.0]]
    vertices = np.array([*floor, [0.3, 1.0, -1.0], [0.3, 1.0, 1.0]])
    shape = vertices, np.array([[0, 1, 2], [0, 2, 3], [1, 2, 5], [1, 5, 4]], dtype=np.uint32)
    found = contacts(shape, [0.0, 0.05, 0.0], [0.5, -0.5, 0.03], 0.02)
    assert np.allclose(found["normal"], [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert np.allclose(found["plane_gap"], [0.03, 0.28])


def test_the_side_is_the_one_on_which_the_path_begins():
    shape = soup(np.random.default_rng(4), 1, 1.0)
    corner = shape[0]
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    normal /= np.linalg.norm(normal)
    for side in (-1.0, 1.0):
        start = corner.mean(axis=0) + side * 0.01 * normal
        found = contacts(shape, start, -side * 0.5 * normal, 0.001)
        assert np.allclose(found["normal"], [side * normal])
        assert found["fraction"][0] == pytest.approx((0.01 - 0.001) / 0.5)


# ---- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("vertices", "triangles", "reason"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "vertices\\[2, 1\\] is nan"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "vertices\\[2, 1\\] is inf"),
        ([[0, 0, 0], [1, 0, 0], [0, 2e3, 0]], [[0, 1, 2]], "outside \\[-1000, 1000\\]"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "triangles\\[0, 2\\] is 3, outside \\[0, 2\\]"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "none of the 1 triangles has an area"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.zeros((0, 3)), "number of triangles is 0"),
        (np.zeros((0, 3)), [[0, 1, 2]], "number of vertices is 0"),
        ([[0, 0], [1, 0], [2, 0]], [[0, 1, 2]], "shape"),
    ],
)
def test_a_mesh_that_cannot_be_is_refused_with_the_reason(vertices, triangles, reason):
    with pytest.raises(engine.InputError, match=reason):
        engine.mesh_distance(np.array(vertices, float), np.array(triangles, "u4"), STILL)


def test_triangles_without_an_area_are_not_there():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    triangles = np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2]], dtype=np.uint32)
    assert engine.mesh_query(vertices, triangles, (-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)) == [0]
    assert engine.mesh_distance(vertices, triangles, [[2.0, 0.0, 0.0]])[0] == 1.0


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"vertices": [[0, 0, 0], [1, 0, 0], [0, "x", 0]]}, "mesh.vertices"),
        ({"vertices": [[0, 0, 0], [1, 0], [0, 1, 0]]}, "mesh.vertices"),
        ({"vertices": [[0, 0, 0], [1, 0, 0], [0, float("nan"), 0]]}, "mesh.vertices is nan at \\[2, 1\\]"),
        ({"triangles": [[0, 1, 2.5]]}, "mesh.triangles is an array of float64, must be whole numbers"),
        ({"triangles": [[0, 1, -1]]}, "mesh.triangles names vertex -1"),
        ({"triangles": [[0, 1, 3]]}, "mesh.triangles name vertex 3, but there are only 3"),
        ({"triangles": []}, "mesh.triangles has shape"),
        ({"scale": "1 kg"}, "mesh.scale"),
        ({"vertices": [[0, 0, 0], [300, 0, 0], [0, 300, 0]]}, "is their unit missing, as in scale = 'mm'"),
        ({"orientation": (0, 0, 0, 0)}, "mesh.orientation must not be zero"),
        ({"motion": {"kind": "belt"}}, "mesh.motion"),
        ({"role": "lamp"}, "mesh.role"),
    ],
)
def test_a_part_that_cannot_be_is_refused_with_its_path(fields, reason):
    good = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]}
    assert cesim.Mesh(**good).scale == 1.0
    with pytest.raises(cesim.InputError, match=reason):
        cesim.Mesh(**{**good, **fields})


# ---- how the triangles hang together ---------------------------------------------------------------------------------


def part(shape, **fields):
    return cesim.Mesh(vertices=shape[0].tolist(), triangles=shape[1].tolist(), **fields)


def test_seams_are_counted_whether_corners_are_shared_or_not():
    shape = box((1.0, 1.0, 1.0))
    apart = shape[0][shape[1]].reshape(-1, 3), np.arange(36, dtype=np.uint32).reshape(-1, 3)
    for vertices, triangles in (shape, apart):
        edges, count = seams(vertices, triangles)
        assert len(edges) == 18  # 12, and a diagonal a face
        assert (count == 2).all()


def test_the_check_says_how_a_mesh_is_open_and_where_it_branches():
    assert flaws(part(box((1.0, 1.0, 1.0)))) == []
    assert flaws(part(tube(1.0, 1.0, 6, 1))) == ["is open: 12 of its 24 edges belong to one triangle only"]
    vertices = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 2]]
    fan = cesim.Mesh(vertices=vertices, triangles=[[0, 1, 2], [0, 1, 3], [1, 0, 4], [0, 1, 5], [2, 1, 0]])
    branches, flat, twice = flaws(fan)[1:]
    assert branches.startswith("branches: 2 of its 7 edges") or "branches" in branches
    assert flat == "has 1 triangles without an area, which are left out"
    assert twice == "has 1 triangles that lie on another one"
    warnings = cesim.Scene(meshes=[fan]).check()
    assert any(w.name == "mesh" and "meshes[0] is open" in w.text for w in warnings)


# ---- files -----------------------------------------------------------------------------------------------------------


def binary_stl(vertices, triangles, header=b"made by hand", count=None):
    body = b"".join(
        struct.pack("<12fH", 0.0, 0.0, 0.0, *vertices[t].astype("f4").ravel(), 0) for t in np.asarray(triangles)
    )
    return header.ljust(80) + struct.pack("<I", len(triangles) if count is None else count) + body


def ascii_stl(vertices, triangles, newline="\n"):
    lines = ["solid part"]
    for t in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in vertices[t].tolist()]
        lines += ["endloop", "endfacet"]
    return newline.join([*lines, "endsolid part", ""]).encode()


def obj(vertices, triangles):
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return "\n".join(rows + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()] + [""]).encode()


def ply(vertices, triangles):
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
    )
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return (head + "\n".join(rows + [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]) + "\n").encode()


BOX = box((4.0, 2.0, 1.0))  # its coordinates are exact in single precision
GOOD = {
    "binary.stl": binary_stl(*BOX),
    "solid.stl": binary_stl(*BOX, header=b"solid facet vertex"),
    "ascii.stl": ascii_stl(*BOX),
    "crlf.stl": ascii_stl(*BOX, newline="\r\n"),
    "upper.STL": ascii_stl(*BOX).upper(),
    "part.obj": obj(*BOX),
    "part.ply": ply(*BOX),
}


@pytest.mark.parametrize("name", GOOD)
def test_a_file_gives_the_triangles_that_were_written(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(GOOD[name])
    vertices, triangles = read_mesh(path)
    assert len(vertices) == 8
    want = np.sort(BOX[0][BOX[1]].reshape(-1, 9), axis=0)
    assert np.array_equal(np.sort(vertices[triangles].reshape(-1, 9), axis=0), want)


NAN = BOX[0].copy()
NAN[3, 1] = np.nan
FAR = BOX[1] + 5


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.stl", b"", "it has 0 bytes"),
        ("a.stl", binary_stl(BOX[0], BOX[1][:0]), "has no triangles"),
        ("a.stl", binary_stl(*BOX, count=13), "announces 13 triangles, which take 734 bytes; it has 684"),
        ("a.stl", binary_stl(*BOX, count=2**32 - 1), "announces 4294967295 triangles"),
        ("a.stl", binary_stl(*BOX)[:-10], "announces 12 triangles"),
        ("a.stl", binary_stl(*BOX, header=b"solid")[:-10], "announces 12 triangles"),
        ("a.stl", binary_stl(NAN, BOX[1]), "not finite"),
        ("a.stl", ascii_stl(*BOX)[:700], "cut short"),
        ("a.stl", ascii_stl(*BOX).replace(b"0.5", b"0,5"), "decimal commas"),
        ("a.stl", ascii_stl(NAN, BOX[1]), "not finite"),
        ("a.stl", ascii_stl(*BOX).replace(b"2.0", b"two", 1), "damaged"),
        ("a.stl", b"solid part\nendsolid part\n".ljust(100), "no triangles"),
        ("a.stl", obj(*BOX), "announces"),
        ("a.obj", obj(BOX[0], FAR), "a.obj"),
        ("a.obj", obj(NAN, BOX[1]), "a.obj"),
        ("a.obj", obj(*BOX).replace(b"0.5", b"0,5"), "decimal commas"),
        ("a.obj", b"", "a.obj"),
        ("a.ply", ply(*BOX)[:-40], "a.ply"),
        ("a.ply", ply(BOX[0], FAR), "a.ply"),
        ("a.ply", ply(NAN, BOX[1]), "a.ply"),
        ("a.ply", ply(*BOX).replace(b"face 12", b"face 4000000000"), "announces 4000000000 of face"),
        ("a.ply", b"", "a.ply"),
        ("a.txt", b"", "must end in .stl, .obj, .ply"),
    ],
)
def test_a_file_that_is_no_mesh_is_refused_with_its_name_and_the_reason(name, content, reason, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(cesim.InputError, match=reason) as caught:
        read_mesh(path)
    assert name in str(caught.value)
    assert caught.value.path == "file"


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(cesim.InputError, match=r"chute\.stl"):
        cesim.Mesh.read(tmp_path / "chute.stl")


@settings(max_examples=300, deadline=None)
@given(
    name=st.sampled_from(sorted(GOOD)),
    cut=st.floats(0.0, 1.0),
    place=st.floats(0.0, 1.0),
    noise=st.binary(max_size=20),
)
def test_damage_is_read_or_refused_and_nothing_else(name, cut, place, noise, tmp_path_factory):
    content = GOOD[name]
    at = int(place * len(content))
    content = (content[:at] + noise + content[at + len(noise) :])[: int(cut * len(content)) if cut < 0.5 else None]
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(content)
    with suppress(cesim.InputError):
        vertices, triangles = read_mesh(path)
        assert np.isfinite(vertices).all()
        assert triangles.max() < len(vertices)


# ---- in a scene ------------------------------------------------------------------------------------------------------


def test_a_scene_file_names_a_mesh_and_the_saved_scene_holds_it(tmp_path):
    (tmp_path / "chute.stl").write_bytes(binary_stl(*BOX))
    (tmp_path / "scene.toml").write_text('cesim = 1\n[[meshes]]\nfile = "chute.stl"\nscale = "mm"\nfriction = 0.3\n')
    scene = cesim.load(tmp_path / "scene.toml")
    assert scene.meshes[0].scale == 1e-3
    text = scene.to_toml()
    assert "    [-2.0, -1.0, -0.5],\n" in text
    again = cesim.Scene.from_toml(text)
    assert again == scene
    assert again.to_toml() == text
    row = scene.definition()["surfaces"][0]
    assert row["name"] == "meshes[0]"
    assert np.array_equal(np.sort(row["vertices"], axis=0), np.sort(1e-3 * BOX[0], axis=0))


@pytest.mark.parametrize("name", ["../chute.stl", "/tmp/chute.stl"])
def test_a_file_outside_of_the_scenes_folder_is_not_read(name, tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "scene.toml").write_text(f'cesim = 1\n[[meshes]]\nfile = "{name}"\n')
    with pytest.raises(cesim.InputError, match=r"^meshes\[0\].file is .*outside the scene's folder"):
        cesim.load(folder / "scene.toml")


def test_a_file_beside_numbers_and_a_damaged_file_are_refused_with_their_place(tmp_path):
    (tmp_path / "scene.toml").write_text('[[meshes]]\nfile = "a.stl"\nvertices = [[0, 0, 0]]\n')
    with pytest.raises(cesim.InputError, match=r"^meshes\[0\].file stands beside"):
        cesim.load(tmp_path / "scene.toml")
    (tmp_path / "a.stl").write_bytes(b"no")
    (tmp_path / "scene.toml").write_text('[[meshes]]\nfile = "a.stl"\n')
    with pytest.raises(cesim.InputError, match=r"^meshes\[0\].file .*a.stl.* is no STL file"):
        cesim.load(tmp_path / "scene.toml")


def test_a_turning_mesh_counts_for_the_reference_speed():
    from cesim.scene.effects import reference_speed

    mesh = part(box((0.4, 0.3, 0.2)), motion=cesim.Rotation(speed=-8.0))
    assert reference_speed(cesim.Scene(meshes=[mesh])) == pytest.approx(8.0 * 0.25)


def test_the_picture_of_the_machine_shows_the_edges_of_a_mesh():
    from matplotlib.figure import Figure

    from cesim.plots import draw_machine, outline

    mesh = part(box((0.4, 0.2, 0.1)), position=(0.1, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 1.0))  # a quarter turn
    definition = cesim.Scene(meshes=[mesh]).definition()
    assert np.allclose(outline(definition["surfaces"][0]).max(axis=0), [0.2, 0.2])
    ax = Figure().subplots()
    draw_machine(definition, ax)
    (lines,) = ax.collections
    assert len(lines.get_segments()) == 18
