"""glTF files: axes, transforms, exact factors, textures in their colour spaces, and a clear line for what is wrong."""

import numpy as np
import pytest
import trimesh
from gltf_builder import TRIANGLE, TRIANGLE_UV, Gltf, beside, triangle
from splitnerf.data.gltf import document, geometry, read_asset
from splitnerf.data.images import decode_image, encode_image, srgb_to_linear
from splitnerf.errors import InputError


def z_up(vectors):
    return np.stack([vectors[:, 0], -vectors[:, 2], vectors[:, 1]], axis=1)


def face_normals(asset):
    a, b, c = (asset.vertices[asset.triangles[:, k]] for k in range(3))
    crosses = np.cross(b - a, c - a)
    return crosses / np.linalg.norm(crosses, axis=1, keepdims=True)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.glb"


# ---- geometry ----


def test_without_normals_shading_is_flat(path):
    position = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], np.float32)
    asset = read_asset(triangle(position=position, indices=[0, 1, 2, 1, 3, 2]).write(path))
    assert len(asset.vertices) == 6  # shared vertices part
    for corner in range(3):
        assert asset.normals[asset.triangles[:, corner]] == pytest.approx(face_normals(asset), abs=1e-6)


def test_nodes_translate_turn_scale_in_that_order_down_the_tree(path):
    gltf = Gltf()
    mesh = gltf.mesh(gltf.primitive(NORMAL=[[0, 0, 1]] * 3))
    child = gltf.node(root=False, mesh=mesh, scale=[2, 3, 4], rotation=[0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    middle = gltf.node(root=False, children=[child], matrix=[*np.eye(4).flat[:12], 10, 20, 30, 1])  # by columns
    gltf.node(children=[middle], rotation=[np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    asset = read_asset(gltf.write(path))
    # Scaled, then a quarter turn about z of the file takes (x, y) to (-y, x), then moved; one about x takes y up to z there.
    expected = TRIANGLE * [2, 3, 4]
    expected = np.stack([-expected[:, 1], expected[:, 0], expected[:, 2]], axis=1) + [10, 20, 30]
    expected = np.stack([expected[:, 0], -expected[:, 2], expected[:, 1]], axis=1)
    assert asset.vertices == pytest.approx(z_up(expected), abs=1e-5)
    assert asset.normals == pytest.approx(np.tile([0, 0, -1], (3, 1)), abs=1e-6)  # -y of the file


def test_instances_repeat_and_a_mirrored_one_still_faces_outward(path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    gltf = Gltf()
    mesh = gltf.mesh(gltf.primitive(ball.vertices, ball.faces, NORMAL=ball.vertices))
    gltf.node(mesh=mesh)
    gltf.node(mesh=mesh, translation=[5, 0, 0], scale=[-1, 2, 1])
    asset = read_asset(gltf.write(path))
    assert len(asset.triangles) == 2 * len(ball.faces)
    centres = np.where(asset.vertices[asset.triangles].mean(axis=1)[:, :1] > 2.5, [[5, 0, 0]], [[0, 0, 0]])
    outward = asset.vertices[asset.triangles].mean(axis=1) - centres
    assert ((face_normals(asset) * outward).sum(axis=1) > 0).all()
    # The ellipsoid's normals are the gradient of its equation, y of the file being z here.
    second = asset.vertices[:, 0] > 2.5
    gradient = (asset.vertices[second] - [5, 0, 0]) / [1, 1, 4]
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert asset.normals[second] == pytest.approx(gradient, abs=1e-5)


def test_strips_and_fans_become_triangles(path):
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    for mode, indices in ((5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        asset = read_asset(triangle(position=square, indices=indices, mode=mode).write(path))
        assert len(asset.triangles) == 2
        assert face_normals(asset) == pytest.approx(np.tile([0, -1, 0], (2, 1)), abs=1e-6)


def test_interleaved_sparse_and_quantised_accessors(path):
    gltf = Gltf()
    primitive = gltf.primitive()
    rows = np.zeros((3, 5), np.float32)
    rows[:, :3], rows[:, 3:] = TRIANGLE, TRIANGLE_UV
    view = gltf.view(rows.tobytes(), byteStride=20)
    base = {"bufferView": view, "componentType": 5126, "count": 3}
    indices, values = gltf.view(np.array([1], "<u2").tobytes()), gltf.view(np.array([7, 8, 9], "<f4").tobytes())
    sparse = {"count": 1, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}}
    gltf.json["accessors"] += [base | {"type": "VEC3", "sparse": sparse}, base | {"type": "VEC2", "byteOffset": 12}]
    count = len(gltf.json["accessors"])
    primitive["attributes"] |= {"POSITION": count - 2, "TEXCOORD_0": count - 1}
    primitive["attributes"]["NORMAL"] = gltf.accessor([[0, 0, 127]] * 3, "int8", normalized=True)
    primitive["attributes"]["COLOR_0"] = gltf.accessor([[255, 51, 0, 255]] * 3, "uint8", normalized=True)
    slot = {"index": gltf.texture(np.ones((2, 2, 3)))}
    primitive["material"] = gltf.material(pbrMetallicRoughness={"baseColorTexture": slot})
    gltf.node(mesh=gltf.mesh(primitive))
    asset = read_asset(gltf.write(path))
    assert asset.vertices == pytest.approx(z_up(np.array([[0, 0, 0], [7, 8, 9], [0, 1, 0]])), abs=1e-6)
    assert asset.uv == pytest.approx(TRIANGLE_UV)
    assert asset.normals == pytest.approx(np.tile([0, -1, 0], (3, 1)))
    assert asset.colors == pytest.approx(np.tile([1, 0.2, 0], (3, 1)))


def test_skin_stands_in_its_rest_pose(path, capsys):
    gltf = Gltf()
    primitive = gltf.primitive(NORMAL=[[0, 0, 1]] * 3)
    primitive["attributes"]["JOINTS_0"] = gltf.accessor([[0, 1, 0, 0]] * 3, "uint8")
    primitive["attributes"]["WEIGHTS_0"] = gltf.accessor([[2, 0, 0, 0], [0, 1, 0, 0], [0.5, 0.5, 0, 0]])
    joints = [gltf.node(translation=[0, 0, 2], scale=[3, 3, 3]), gltf.node(translation=[0, 4, 0])]
    bind = gltf.accessor([(np.eye(4) + 1 * np.eye(4, k=3)).T, np.eye(4)])  # by columns: the first moves by 1 along x
    gltf.json["skins"] = [{"joints": joints, "inverseBindMatrices": bind}]
    gltf.node(mesh=gltf.mesh(primitive), skin=0, translation=[100, 0, 0])  # without effect, as glTF prescribes
    asset = read_asset(gltf.write(path))
    first, second = 3 * (TRIANGLE + [1, 0, 0]) + [0, 0, 2], TRIANGLE + [0, 4, 0]
    moved = [first[0], second[1], (first[2] + second[2]) / 2]
    assert asset.vertices == pytest.approx(z_up(np.array(moved)), abs=1e-6)
    assert "has a skin; drawn in its rest pose" in capsys.readouterr().err


# ---- materials ----


def test_materials_textures_and_colour_spaces(path):
    gltf = Gltf()
    levels = np.random.default_rng(0).integers(0, 256, (4, 2, 3)) / 255
    slot = {"index": gltf.texture(levels)}
    factors = {"baseColorFactor": [0.123456789, 0.5, 0.7, 0.3], "roughnessFactor": 0.345678901, "metallicFactor": 0.25}
    paint = gltf.material(
        name="painted",
        emissiveFactor=[0.25, 0.5, 1.0],
        emissiveTexture=slot,
        normalTexture=slot | {"scale": 0.5},
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
        pbrMetallicRoughness=factors | {"baseColorTexture": slot, "metallicRoughnessTexture": slot},
    )
    plain = gltf.material(name="plain", pbrMetallicRoughness={"roughnessFactor": 0.5})
    normal = {"NORMAL": [[0, 0, 1]] * 3}
    parts = [
        gltf.primitive(material=plain, **normal),
        gltf.primitive(TRIANGLE + 1, material=paint, TEXCOORD_0=TRIANGLE_UV, COLOR_0=[[0.5, 0.25, 1e-4]] * 3, **normal),
        gltf.primitive(TRIANGLE + 2, material=plain, **normal),
    ]
    gltf.node(mesh=gltf.mesh(*parts))
    asset = read_asset(gltf.write(path))
    assert [m.name for m in asset.materials] == ["plain", "painted"] and asset.material_ids.tolist() == [0, 1, 0]
    first, second = asset.materials
    assert (first.albedo, first.roughness, first.metallic) == ((1, 1, 1), 0.5, 1.0)  # glTF's defaults
    assert first.albedo_texture is None and first.normal_texture is None
    assert second.albedo == pytest.approx((0.123456789, 0.5, 0.7), abs=1e-9)
    assert (second.roughness, second.metallic) == pytest.approx((0.345678901, 0.25), abs=1e-9)
    assert second.emission == (1, 2, 4)
    assert second.albedo_texture == pytest.approx(srgb_to_linear(levels), abs=1e-6)
    assert second.emission_texture == pytest.approx(srgb_to_linear(levels), abs=1e-6)
    assert second.roughness_metallic_texture == pytest.approx(levels[..., 1:], abs=1e-6)
    assert second.normal_texture == pytest.approx((2 * levels - 1) * [0.5, 0.5, 1], abs=1e-6)
    assert asset.uv[3:6] == pytest.approx(TRIANGLE_UV) and not asset.uv[:3].any()
    assert asset.colors[3:6] == pytest.approx(np.tile([0.5, 0.25, 1e-4], (3, 1))) and (asset.colors[:3] == 1).all()


def test_tangents_from_coordinates_and_from_the_file(path):
    # u grows along +x of the file, v downward along -y: the tangent is +x, the bitangent +y, z here.
    for given in (None, [[1, 0, 0, 1]] * 3):
        for mirror in (1, -1):
            gltf = Gltf()
            material = gltf.material(normalTexture={"index": gltf.texture(np.full((2, 2, 3), 0.5))})
            extra = {} if given is None else {"TANGENT": given}
            part = gltf.primitive(material=material, TEXCOORD_0=TRIANGLE_UV, NORMAL=[[0, 0, 1]] * 3, **extra)
            gltf.node(mesh=gltf.mesh(part), scale=[mirror, 1, 1])
            asset = read_asset(gltf.write(path))
            tangent, sign = asset.tangents[:, :3], asset.tangents[:, 3:]
            assert tangent == pytest.approx(np.tile([mirror, 0, 0], (3, 1)), abs=1e-6)
            assert sign * np.cross(asset.normals, tangent) == pytest.approx(np.tile([0, 0, 1], (3, 1)), abs=1e-6)


def test_tangents_part_where_the_texture_is_mirrored(path):
    # Two triangles share the edge x = 0; u = |x| on both, so u grows away from it to either side.
    position = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0]], np.float32)
    uv = np.stack([np.abs(position[:, 0]), 1 - position[:, 1]], axis=1)
    gltf = Gltf()
    material = gltf.material(normalTexture={"index": gltf.texture(np.full((2, 2, 3), 0.5))})
    part = gltf.primitive(position, [0, 2, 1, 0, 1, 3], material=material, TEXCOORD_0=uv, NORMAL=[[0, 0, 1]] * 4)
    gltf.node(mesh=gltf.mesh(part))
    asset = read_asset(gltf.write(path))
    corners = z_up(position)[[[0, 2, 1], [0, 1, 3]]]
    assert asset.vertices[asset.triangles] == pytest.approx(corners) and len(asset.vertices) == 6
    assert asset.uv[asset.triangles] == pytest.approx(uv[[[0, 2, 1], [0, 1, 3]]])
    for triangle_tangents, side in zip(asset.tangents[asset.triangles], (1, -1)):
        assert triangle_tangents == pytest.approx(np.tile([side, 0, 0, side], (3, 1)), abs=1e-6)


def test_texture_transform_and_second_set(path):
    # The extension's order: scaled by (2, 3), turned a quarter counter-clockwise with v downward, moved.
    gltf = Gltf()
    transform = {"scale": [2, 3], "rotation": np.pi / 2, "offset": [0.1, 0.2], "texCoord": 1}
    slot = {"index": gltf.texture(np.ones((2, 2, 1))), "extensions": {"KHR_texture_transform": transform}}
    material = gltf.material(pbrMetallicRoughness={"baseColorTexture": slot})
    part = gltf.primitive(material=material, NORMAL=[[0, 0, 1]] * 3, TEXCOORD_0=TRIANGLE_UV * 0, TEXCOORD_1=TRIANGLE_UV)
    gltf.node(mesh=gltf.mesh(part))
    gltf.json["extensionsRequired"] = ["KHR_texture_transform"]
    asset = read_asset(gltf.write(path))
    assert np.array_equal(asset.materials[0].albedo_texture, np.ones((2, 2, 3)))  # grey is repeated
    scaled = TRIANGLE_UV * [2, 3]
    assert asset.uv == pytest.approx(np.stack([scaled[:, 1], -scaled[:, 0]], axis=1) + [0.1, 0.2], abs=1e-6)


def test_repairs_are_said(path, capsys):
    gltf = triangle(NORMAL=[[0, 0, 0]] * 3)
    gltf.json["meshes"][0]["primitives"][0]["targets"] = [{}]
    gltf.json["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 0})
    gltf.json["animations"] = [{}]
    gltf.json["extensionsUsed"] = ["KHR_lights_punctual"]
    asset = read_asset(gltf.write(path))
    assert asset.normals == pytest.approx(np.tile([0, -1, 0], (3, 1)))
    material = asset.materials[0]
    assert (material.albedo, material.roughness, material.metallic) == ((1, 1, 1), 1.0, 1.0)
    said = capsys.readouterr().err
    for text in (
        "no material; drawn as glTF's default",
        "morph targets; drawn in its base shape",
        "points or lines; left out",
        "animations; drawn as it stands",
        "uses KHR_lights_punctual; left out",
        "normals of length 0",
    ):
        assert text in said
    g = triangle()  # compressed, beside what it is made of; with colours of an older kind
    old = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.8, 0.1, 0.1, 1]}}
    packed = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    g.json["meshes"][0]["primitives"][0] |= {"material": g.material(name="old", extensions=old), "extensions": packed}
    g.json["extensionsUsed"] = [*packed]
    assert read_asset(g.write(path)).vertices == pytest.approx(z_up(TRIANGLE))
    said = capsys.readouterr().err
    assert "uses KHR_draco_mesh_compression, KHR_materials_pbrSpecularGlossiness; left out" in said
    assert "the colours of 'old', specular and glossiness, are not read; drawn as white metal" in said
    gltf = Gltf()
    clear = {"KHR_materials_transmission": {}}  # which the file does not declare
    extra = {"emissiveFactor": [0.25, 0, 0.5], "pbrMetallicRoughness": {"metallicFactor": -0.5}}
    material = gltf.material(name="glass", alphaMode="BLEND", extensions=clear, **extra)
    colours = gltf.accessor([[255, 0, 0, 255]] * 3, "uint8")  # not normalised
    gltf.node(mesh=gltf.mesh(gltf.primitive(material=material, COLOR_0=colours)))
    (read,) = read_asset(gltf.write(path)).materials
    assert (read.emission, read.roughness, read.metallic) == ((0.25, 0, 0.5), 1, 0)  # of no strength: as it is
    said = capsys.readouterr().err
    assert "material 'glass' has a factor outside [0, 1]; clipped" in said
    assert "material 'glass' is transparent (alphaMode BLEND); drawn opaque" in said
    assert "uses KHR_materials_transmission; left out" in said
    assert "mesh 'part' has vertex colours outside [0, 1]; clipped" in said


# ---- buffers in files of their own ----


INLINE = "data:application/octet-stream;base64,{inline}"


@pytest.mark.parametrize("uri", ["sub/the%20data.bin", "./sub/../sub/the%20data.bin", "inside.bin", INLINE])
def test_buffers_below_the_folder_are_read(tmp_path, uri):
    whole = read_asset(triangle().write(tmp_path / "a.glb"))
    assert np.array_equal(read_asset(beside(tmp_path, uri)).vertices, whole.vertices)


def test_a_buffer_that_nothing_uses_may_be_missing(path):
    gltf = triangle()
    gltf.json["buffers"] = [{"byteLength": len(gltf.binary)}, {"uri": "x" * 5000, "byteLength": 4}]
    assert len(read_asset(gltf.write(path)).triangles) == 1


def test_a_file_that_needs_more_memory_than_there_is_is_refused(path, monkeypatch):
    """3 + 3 values of 40 bytes, of half of what is available."""
    triangle().write(path)
    monkeypatch.setattr(document, "memory_bytes", lambda: (1 << 40, 1 << 16))
    read_asset(path)
    monkeypatch.setattr(document, "memory_bytes", lambda: (1 << 40, 2 * 40 * 8))
    with pytest.raises(InputError, match="needs more than half of the available memory"):
        read_asset(path)


def test_the_pixels_of_a_texture_cost_more_before_they_are_unpacked():
    grey, asked = encode_image(np.zeros((8, 16, 1)), ".png"), []
    with pytest.raises(ZeroDivisionError):
        decode_image(grey[:60], "x", lambda n_values: asked.append(n_values) or 1 / 0)
    assert asked == [8 * 16 * 3]


def test_many_nodes_are_told_of(path, capsys, monkeypatch):
    gltf = triangle()
    gltf.json["nodes"] += [{}, {}]
    gltf.json["scenes"][0]["nodes"] += [1, 2]
    gltf.write(path)
    read_asset(path)
    assert " nodes, " not in capsys.readouterr().err
    monkeypatch.setattr(geometry, "MANY_NODES", 2)
    read_asset(path)
    assert "has 3 nodes, which takes a while; join its meshes" in capsys.readouterr().err


def test_a_long_name_is_shortened_in_a_message(path, capsys):
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(gltf.primitive(material=gltf.material(name="x" * 5000, alphaMode="BLEND"))))
    read_asset(gltf.write(path))
    said = [line for line in capsys.readouterr().err.splitlines() if "xxx" in line]
    assert len(said) == 1 and len(said[0]) < 2100 and said[0].endswith("(alphaMode BLEND); drawn opaque")


def numbers_without_a_buffer(g: Gltf) -> None:
    g.json["accessors"].append({"componentType": 5126, "count": 1 << 17, "type": "VEC3"})
    g.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 1


def many_primitives(g: Gltf) -> None:
    """A mesh of 800, placed 800 times."""
    mesh = g.mesh(*[g.primitive()] * 800)
    for _ in range(800):
        g.node(mesh=mesh)


def many_instances(g: Gltf) -> None:
    """Of the largest mesh that the file's size allows."""
    g.json["accessors"][0] = {"componentType": 5126, "count": 3 * 10**5, "type": "VEC3"}
    for _ in range(300):
        g.node(mesh=0)


@pytest.mark.parametrize("change", [numbers_without_a_buffer, many_primitives, many_instances])
def test_what_unpacks_to_more_than_its_size_is_refused(path, change):
    scene = triangle()
    change(scene)
    with pytest.raises(InputError, match="unpacks to more than its size makes likely"):
        read_asset(scene.write(path))
