"""The extension inside bpy: installed from its zip, used by its buttons, saved, opened again, and
held against the command line."""

import csv
import json
import os
import subprocess
import sys

import bpy
import numpy as np
import pytest

PACKAGE = "bl_ext.user_default.barymap"
#: Of the demo's pairs, which are spread over the body in this order.
COUNT = 16
SIZE, LANDMARKS = 256, 300


@pytest.fixture(scope="session", autouse=True)
def installed():
    """The extension, switched on; its wheel can be imported then."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    done = bpy.ops.extensions.package_install_files(
        filepath=os.environ["BARYMAP_EXTENSION"], repo="user_default", enable_on_install=True
    )
    assert done == {"FINISHED"}
    import barymap

    assert os.environ["BLENDER_USER_RESOURCES"] in barymap.__file__, "the wheel of the extension"
    return sys.modules[PACKAGE]


def program(*words):
    """The command line of the wheel."""
    import barymap

    place = os.path.dirname(os.path.dirname(barymap.__file__))
    env = {**os.environ, "PYTHONPATH": place}
    words = [sys.executable, "-m", "barymap", *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True, env=env, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    size = "1024" if "PICTURES" in os.environ else "256"
    program("demo", "--size", size, "-o", folder, "--quiet")
    return folder


def add_object(name, mesh):
    """An object of a mesh of barymap, with its UV map."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    data.uv_layers.new(name="UVMap").data.foreach_set("uv", mesh.uv.reshape(-1).astype(np.float32))
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def textured(obj, pixels):
    """A material with images as base colour and, through a separator, roughness."""
    material = bpy.data.materials.new("skin")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next((n for n in nodes if n.type == "BSDF_PRINCIPLED"), None) or nodes.new("ShaderNodeBsdfPrincipled")
    for socket, values in (("Base Color", pixels), ("Roughness", pixels[:, :, :1].repeat(3, axis=2))):
        height, width = values.shape[:2]
        image = bpy.data.images.new(socket, width, height)
        image.colorspace_settings.name = "sRGB" if socket == "Base Color" else "Non-Color"
        whole = np.ones((height, width, 4), np.float32)
        whole[:, :, :3] = values[:, :, :3] / 255
        image.pixels.foreach_set(whole[::-1].ravel())
        image.pack()
        node = nodes.new("ShaderNodeTexImage")
        node.image = image
        if socket == "Roughness":
            split = nodes.new("ShaderNodeSeparateColor")
            links.new(node.outputs["Color"], split.inputs["Color"])
            links.new(split.outputs["Green"], shader.inputs[socket])
        else:
            links.new(node.outputs["Color"], shader.inputs[socket])
    obj.data.materials.append(material)


@pytest.fixture
def scene(demo, tmp_path):
    """Two objects, the source textured, with weights and a shape key; the target elsewhere, turned
    and scaled by other factors along each axis."""
    import barymap

    clear()
    source = add_object("A", barymap.read(demo / "source.obj"))
    target = add_object("B", barymap.read(demo / "target.obj"))
    target.location, target.rotation_euler, target.scale = (2, 0.5, 0), (0, 0, 0.3), (1.2, 0.9, 1.1)
    textured(source, barymap.read_image(demo / "source_texture.png"))
    height = np.array([v.co.y for v in source.data.vertices])
    for name, share in (("up", height > 1.0), ("down", height <= 1.0)):
        group = source.vertex_groups.new(name=name)
        group.add(np.flatnonzero(share).tolist(), 1.0, "REPLACE")
    source.shape_key_add(name="Basis")
    key = source.shape_key_add(name="long arms")
    for point in key.data:
        point.co.x *= 1.3
    colors = source.data.color_attributes.new(name="Col", type="FLOAT_COLOR", domain="POINT")
    values = np.c_[np.clip(height / 1.7, 0, 1), 0 * height, 0 * height, 0 * height + 1]
    colors.data.foreach_set("color", values.astype(np.float32).ravel())
    chosen = bpy.context.scene.barymap
    chosen.source, chosen.target = source, target
    chosen.size, chosen.landmarks = SIZE, LANDMARKS
    known = json.loads((demo / "pairs.json").read_text())
    chosen_pairs = {side: known[side][:COUNT] for side in ("source", "target")}
    (tmp_path / "pairs.json").write_text(json.dumps(chosen_pairs))
    assert bpy.ops.barymap.read_pairs(filepath=str(tmp_path / "pairs.json")) == {"FINISHED"}
    return source, target


def clear():
    """An empty scene, with the extension on."""
    for collection in (bpy.data.objects, bpy.data.meshes, bpy.data.materials, bpy.data.images):
        for item in list(collection):
            collection.remove(item)


def module(name):
    return sys.modules[f"{PACKAGE}.{name}"]


def exported(folder, source, target):
    """The objects as files in the units of the world, and the pairs: what the command line gets."""
    for name, obj in (("source", source), ("target", target)):
        module("arrays").Surface(obj, False).mesh().write(folder / f"{name}.obj")
    assert bpy.ops.barymap.write_pairs(filepath=str(folder / "world.json")) == {"FINISHED"}
    return [
        "--source", folder / "source.obj", "--target", folder / "target.obj", "--anchors", folder / "world.json",
        "--landmarks", LANDMARKS,
    ]


def vertices(obj, key=None):
    data = obj.data.vertices if key is None else obj.data.shape_keys.key_blocks[key].data
    return module("arrays").read(data, "co", 3).reshape(-1, 3)


def test_textures_weights_and_shape_keys_are_the_command_lines(scene, tmp_path):
    import barymap

    source, target = scene
    assert bpy.ops.barymap.textures() == {"FINISHED"}
    assert bpy.ops.barymap.weights() == {"FINISHED"}
    assert bpy.ops.barymap.colors() == {"FINISHED"}
    assert bpy.ops.barymap.shape_keys() == {"FINISHED"}
    assert bpy.ops.barymap.coverage() == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    clear()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    source, target = bpy.data.objects["A"], bpy.data.objects["B"]
    assert len(module("pairs").complete()) == COUNT

    words = exported(tmp_path, source, target)
    nodes = module("jobs").texture_nodes(target.active_material)
    assert set(nodes) == {"base_color", "roughness"}
    assert nodes["base_color"].image.colorspace_settings.name == "sRGB"
    given = module("jobs").texture_nodes(source.active_material)
    for role, node in nodes.items():
        barymap.write_image(tmp_path / "in.png", module("arrays").picture(given[role].image))
        program("transfer", *words, "--texture", tmp_path / "in.png", "--size", SIZE, "-o", tmp_path / "out.png")
        expected = barymap.read_image(tmp_path / "out.png")
        made = module("arrays").picture(node.image)
        assert made.shape == expected.shape == (SIZE, SIZE, 4) and made.std() > 5
        assert np.array_equal(made, expected), role
        assert not np.array_equal(made, expected[::-1]), "the comparison sees another picture"

    names, table = module("arrays").weights(source)
    np.save(tmp_path / "in.npy", table)
    program("attributes", *words, "--attributes", tmp_path / "in.npy", "-o", tmp_path / "out.npy")
    carried, made = np.load(tmp_path / "out.npy"), module("arrays").weights(target)
    assert made[0] == names == ["up", "down"]
    assert abs(made[1] - np.clip(carried, 0, 1)).max() < 1e-6 and 0.2 < made[1][:, 0].mean() < 0.8

    change = (vertices(source, "long arms") - vertices(source, "Basis")).astype(np.float64)
    np.save(tmp_path / "in.npy", change)
    program("attributes", *words, "--attributes", tmp_path / "in.npy", "--kind", "vectors", "-o", tmp_path / "out.npy")
    surface = module("arrays").Surface(target, True)
    expected = surface.to_object(np.load(tmp_path / "out.npy"))
    made = vertices(target, "long arms") - vertices(target, "Basis")
    assert abs(made - expected).max() < 1e-5 and abs(made).max() > 0.05

    coverage = target.data.color_attributes["barymap coverage"]
    green = module("arrays").read(coverage.data, "color", 4).reshape(-1, 4)[:, 1]
    program("map", *words, "-o", tmp_path / "map.csv")
    rows = list(csv.DictReader((tmp_path / "map.csv").read_text().splitlines()))
    shown = np.array(["failed", "doubtful", "valid"])[np.searchsorted([0.3, 0.8], green)]
    assert [row["status"] for row in rows] == shown.tolist() and len(set(shown)) > 1
    np.save(tmp_path / "in.npy", module("arrays").colors(source, source.data.color_attributes["Col"]))
    program("attributes", *words, "--attributes", tmp_path / "in.npy", "-o", tmp_path / "out.npy")
    carried = module("arrays").colors(target, target.data.color_attributes["Col"])
    assert abs(carried - np.load(tmp_path / "out.npy")).max() < 1e-6 and carried[:, 0].std() > 0.1


def test_pairs_stick_mirror_and_are_read(scene, tmp_path):
    source, target = scene
    pairs = module("pairs")
    first = pairs.empties()[0]
    assert first["source"].parent == source and first["target"].parent == target
    before = first["target"].matrix_world.translation.copy()
    target.location.x += 3
    bpy.context.view_layer.update()
    assert abs((first["target"].matrix_world.translation - before).x - 3) < 1e-5, "it goes with its object"
    # And where the surface goes.
    at = first["source"].matrix_world.translation.copy()
    source.data.shape_keys.key_blocks["long arms"].value = 1
    bpy.context.view_layer.update()
    gone = first["source"].matrix_world.translation
    assert abs(gone.x - 1.3 * at.x) < 0.02 and abs(gone.x - at.x) > 0.01
    assert (pairs.on_surface(source, gone)[0] - gone).length < 0.02
    source.data.shape_keys.key_blocks["long arms"].value = 0
    first["target"].location.z += 0.3
    assert bpy.ops.barymap.snap() == {"FINISHED"}
    bpy.context.view_layer.update()
    at = first["target"].matrix_world.translation
    assert (pairs.on_surface(target, at)[0] - at).length < 1e-5
    assert bpy.ops.barymap.mirror() == {"FINISHED"}
    count = len(pairs.complete())
    assert COUNT < count <= 2 * COUNT
    assert bpy.ops.barymap.write_pairs(filepath=str(tmp_path / "p.json")) == {"FINISHED"}
    known = pairs.positions()
    assert bpy.ops.barymap.clear() == {"FINISHED"} and pairs.empties() == {}
    assert bpy.ops.barymap.read_pairs(filepath=str(tmp_path / "p.json")) == {"FINISHED"}
    assert all(abs(a - b).max() < 1e-5 for a, b in zip(pairs.positions(), known))


def test_clicks_and_groups_set_pairs(scene):
    source, target = scene
    pairs, operators = module("pairs"), module("operators")
    bpy.ops.barymap.clear()
    from mathutils import Vector

    bpy.context.view_layer.update()
    for obj, side in ((source, "source"), (target, "target")):
        middle = obj.matrix_world @ (sum((Vector(c) for c in obj.bound_box), Vector()) / 8)
        hit = operators.under(obj, middle + Vector((0, 0, 10)), Vector((0, 0, -1)))
        assert hit is not None and (pairs.on_surface(obj, hit)[0] - hit).length < 1e-4
        assert operators.under(obj, middle + Vector((50, 0, 10)), Vector((0, 0, -1))) is None
        pairs.place(bpy.context, obj, side, hit)
    assert pairs.complete() == [0] and pairs.next_number("source") == 1
    for obj in (source, target):
        for name, vertex in (("nose", 5), ("toe", 900)):
            obj.vertex_groups.new(name=name).add([vertex], 1.0, "REPLACE")
    assert bpy.ops.barymap.from_groups() == {"FINISHED"}
    assert len(pairs.complete()) == 3


def test_suggestions_are_ghosts_that_can_be_kept(scene):
    pairs = module("pairs")
    bpy.context.scene.barymap.suggestions = 3
    assert bpy.ops.barymap.suggest() == {"FINISHED"}
    assert 1 <= len(pairs.complete(ghosts=True)) <= 3 and len(pairs.complete()) == COUNT
    ghosts = len(pairs.complete(ghosts=True))
    assert bpy.ops.barymap.keep_ghosts() == {"FINISHED"}
    assert len(pairs.complete()) == COUNT + ghosts and pairs.empties(ghosts=True) == {}


def test_what_cannot_be_done_is_a_sentence(scene):
    source, target = scene
    chosen = bpy.context.scene.barymap

    def refused(operator, words):
        with pytest.raises(RuntimeError) as caught:
            operator()
        assert words in str(caught.value), caught.value

    modifier = target.modifiers.new("Subdivision", "SUBSURF")
    refused(bpy.ops.barymap.weights, "Modifiers of B change its vertices (Subdivision)")
    target.modifiers.remove(modifier)
    chosen.target = source
    refused(bpy.ops.barymap.textures, "the same object")
    chosen.target = None
    refused(bpy.ops.barymap.coverage, "Choose a mesh")
    chosen.target = target
    target.scale.x = 0
    refused(bpy.ops.barymap.coverage, "scale of 0")
    target.scale.x = 1
    while target.data.uv_layers:
        target.data.uv_layers.remove(target.data.uv_layers[0])
    target.data.update()
    refused(bpy.ops.barymap.textures, "no UV map")
    refused(lambda: bpy.ops.barymap.read_pairs(filepath="/nonexistent/p.json"), "No such file")
    bpy.ops.barymap.clear()
    refused(bpy.ops.barymap.coverage, "There are no pairs")


def test_modifiers_that_keep_vertices_count(scene):
    _, target = scene
    modifier = target.modifiers.new("Displace", "DISPLACE")
    modifier.strength = 0.1
    bpy.context.view_layer.update()
    arrays = module("arrays")
    moved = arrays.Surface(target, True)
    modifier.show_viewport = False
    bpy.context.view_layer.update()
    rest = arrays.Surface(target, True)
    assert 0.001 < abs(moved.vertices - rest.vertices).max()


def test_work_in_the_background_stops(scene):
    """What the modal operator does: it starts a job, looks at it, and Esc stops it."""
    import time

    jobs = module("jobs")
    bpy.context.scene.barymap.landmarks = 3000
    job = jobs.Coverage(bpy.context.scene.barymap)
    begun = time.monotonic()
    thread = job.start()
    while job.told[0] == job.title and thread.is_alive():
        time.sleep(0.01)
    assert thread.is_alive(), "it works in the background and tells how far it is"
    job.stopped = True
    thread.join()
    with pytest.raises(module("arrays").Refused, match="Stopped"):
        job.finish()
    print(f"stopped after {time.monotonic() - begun:.2f} s")
