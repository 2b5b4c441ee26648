"""Renders the pictures of docs/blender.md: PICTURES=FOLDER bash tests/blender.sh -k pictures."""

import os

import bpy
import numpy as np
import pytest
from test_extension import COUNT, demo, installed, module, scene  # noqa: F401: fixtures

FOLDER = os.environ.get("PICTURES")


def render(path, *, coverage=False):
    """Both objects from in front, with the pairs as small balls."""
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.8, 0.82, 1)
    bpy.context.scene.world = world
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.9
    camera.location, camera.rotation_euler = (1.0, 1.12, 8), (0, 0, 0)
    bpy.context.scene.collection.objects.link(camera)
    light = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    light.data.energy, light.rotation_euler = 1.4, (-0.5, 0.4, 0)
    bpy.context.scene.collection.objects.link(light)
    look = bpy.context.scene
    look.camera = camera
    look.render.engine, look.cycles.samples, look.cycles.use_denoising = "CYCLES", 48, True
    look.render.resolution_x, look.render.resolution_y = 900, 470
    look.view_settings.view_transform = "Standard"
    look.render.filepath = path
    bpy.ops.render.render(write_still=True)


def balls(radius=0.035):
    """A ball at each point of a pair, of one colour on both sides."""
    pairs = module("pairs")
    palette = np.random.default_rng(4).random((COUNT, 3)) * 0.8 + 0.1
    for k, pair in pairs.empties().items():
        material = bpy.data.materials.new(f"ball {k}")
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*palette[k % COUNT], 1)
        for empty in pair.values():
            bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=empty.matrix_world.translation)
            bpy.context.object.data.materials.append(material)


@pytest.mark.skipif(FOLDER is None, reason="PICTURES names no folder")
def test_pictures(scene):
    source, target = scene
    target.rotation_euler, target.scale, target.location = (0, 0, 0), (1, 1, 1), (2, 0, 0)
    bpy.context.scene.barymap.size = 1024
    bpy.context.view_layer.update()
    assert bpy.ops.barymap.textures() == {"FINISHED"}
    render(os.path.join(FOLDER, "blender_result.png"))
    target.data.materials.clear()
    balls()
    render(os.path.join(FOLDER, "blender_pairs.png"))
    assert bpy.ops.barymap.coverage() == {"FINISHED"}
    material = bpy.data.materials.new("coverage")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    attribute = nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = "barymap coverage"
    links.new(attribute.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    target.data.materials.append(material)
    render(os.path.join(FOLDER, "blender_coverage.png"))
