"""Objects of Blender as arrays, and back.

Meshes are taken as they are seen: with their modifiers, in the units of the world, so that
non-uniform scales count. Everything here touches Blender's data and runs in its main thread.
"""

import bpy
import numpy as np


class Refused(Exception):
    """What cannot be done, in a sentence for the status bar."""


class Surface:
    """A mesh object as arrays.

    vertices : (n, 3), in the world
    faces : (m, 3)
    uv : (m, 3, 2) or None
    linear : (3, 3), from the object's axes to the world's
    """

    def __init__(self, obj, own_vertices):
        """``own_vertices``: the vertices have to be those of the object's own data, as weights and
        shape keys need it."""
        if obj is None or obj.type != "MESH":
            raise Refused("Choose a mesh as source and another one as target")
        if obj.mode == "EDIT":
            obj.update_from_editmode()
        graph = bpy.context.evaluated_depsgraph_get()
        seen = obj.evaluated_get(graph)
        mesh = seen.to_mesh()
        try:
            if own_vertices and len(mesh.vertices) != len(obj.data.vertices):
                names = ", ".join(m.name for m in obj.modifiers if m.show_viewport)
                raise Refused(f"Modifiers of {obj.name} change its vertices ({names}): apply or hide them first")
            mesh.calc_loop_triangles()
            self.name = obj.name
            self.matrix = np.array(seen.matrix_world, dtype=np.float64)
            self.linear = self.matrix[:3, :3]
            if abs(np.linalg.det(self.linear)) < 1e-30:
                raise Refused(f"{obj.name} has a scale of 0: give it another one")
            local = read(mesh.vertices, "co", 3).reshape(-1, 3).astype(np.float64)
            self.vertices = local @ self.linear.T + self.matrix[:3, 3]
            count = len(mesh.loop_triangles)
            self.faces = read(mesh.loop_triangles, "vertices", 3, np.int32).reshape(count, 3)
            if np.linalg.det(self.linear) < 0:
                # A mirrored object shows its outside all the same.
                self.faces = self.faces[:, ::-1]
            self.uv = None
            if mesh.uv_layers.active is not None:
                loops = read(mesh.loop_triangles, "loops", 3, np.int32).reshape(count, 3)
                flat = read(mesh.uv_layers.active.data, "uv", 2).reshape(-1, 2)
                if np.linalg.det(self.linear) < 0:
                    loops = loops[:, ::-1]
                self.uv = flat[loops].astype(np.float64)
        finally:
            seen.to_mesh_clear()
        if count == 0:
            raise Refused(f"{obj.name} has no faces")

    def to_world(self, vectors):
        """Vectors (n, 3) of the object in the world."""
        return vectors @ self.linear.T

    def to_object(self, vectors):
        """Vectors (n, 3) of the world in the object."""
        return vectors @ np.linalg.inv(self.linear).T

    def mesh(self):
        """As a mesh of barymap."""
        import barymap

        return barymap.Mesh(self.vertices, self.faces, self.uv, name=self.name)


def read(collection, field, width, dtype=np.float32):
    """A field of all elements of a collection, flat."""
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(field, values)
    return values


def picture(image):
    """The pixels of an image as (h, w, 4), row 0 at the top: uint8 of byte images, float32 of
    others."""
    width, height = image.size
    if width == 0 or height == 0:
        raise Refused(f"The image {image.name} has no pixels: is its file there?")
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    pixels = values.reshape(height, width, image.channels)[::-1]
    return pixels.copy() if image.is_float else np.rint(pixels * 255).astype(np.uint8)


def new_image(name, pixels, like):
    """An image of pixels (h, w, c), with the colour space of another one, packed into the file."""
    height, width = pixels.shape[:2]
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    if pixels.shape[2] == 2:
        pixels = np.concatenate([np.repeat(pixels[:, :, :1], 3, axis=2), pixels[:, :, 1:]], axis=2)
    is_float = pixels.dtype != np.uint8
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = like.colorspace_settings.name
    whole = np.ones((height, width, 4), np.float32)
    whole[:, :, : pixels.shape[2]] = pixels if is_float else pixels.astype(np.float32) / 255
    image.pixels.foreach_set(np.ascontiguousarray(whole[::-1]).ravel())
    image.update()
    image.pack()
    return image


def weights(obj):
    """Names of the vertex groups, and the weights (n, groups)."""
    names = [group.name for group in obj.vertex_groups]
    table = np.zeros((len(obj.data.vertices), len(names)))
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            table[vertex.index, element.group] = element.weight
    return names, table


def set_weights(obj, names, table):
    """Gives an object vertex groups of these names, in place of those it has."""
    for k, name in enumerate(names):
        group = obj.vertex_groups.get(name)
        if group is not None:
            obj.vertex_groups.remove(group)
        group = obj.vertex_groups.new(name=name)
        for vertex in np.flatnonzero(table[:, k] > 0):
            group.add([int(vertex)], float(table[vertex, k]), "REPLACE")


def colors(obj, attribute):
    """A colour attribute as (n, 4) of the vertices; of corners their mean."""
    flat = read(attribute.data, "color", 4).reshape(-1, 4).astype(np.float64)
    if attribute.domain == "POINT":
        return flat
    loops = read(obj.data.loops, "vertex_index", 1, np.int32)
    count = len(obj.data.vertices)
    sums = np.zeros((count, 4))
    np.add.at(sums, loops, flat)
    return sums / np.maximum(np.bincount(loops, minlength=count), 1)[:, None]


def set_colors(obj, name, values):
    """Gives an object a colour attribute (n, 4) of its vertices, in place of one of that name."""
    known = obj.data.color_attributes.get(name)
    if known is not None:
        obj.data.color_attributes.remove(known)
    attribute = obj.data.color_attributes.new(name=name, type="FLOAT_COLOR", domain="POINT")
    attribute.data.foreach_set("color", np.ascontiguousarray(values, np.float32).ravel())
    return attribute


def shape_keys(obj):
    """Shape keys but the basis: names and changes (n, 3) in the object's axes."""
    keys = obj.data.shape_keys
    if keys is None or len(keys.key_blocks) < 2:
        raise Refused(f"{obj.name} has no shape keys")
    place = lambda block: read(block.data, "co", 3).reshape(-1, 3).astype(np.float64)
    blocks = [b for b in keys.key_blocks if b != keys.reference_key]
    return [(b.name, place(b) - place(b.relative_key), b.slider_min, b.slider_max) for b in blocks]


def set_shape_key(obj, name, change, low, high):
    """Gives an object a shape key, in place of one of that name."""
    if obj.data.shape_keys is None:
        obj.shape_key_add(name="Basis", from_mix=False)
    keys = obj.data.shape_keys
    known = keys.key_blocks.get(name)
    if known is not None and known != keys.reference_key:
        obj.shape_key_remove(known)
    block = obj.shape_key_add(name=name, from_mix=False)
    basis = read(keys.reference_key.data, "co", 3).reshape(-1, 3)
    block.data.foreach_set("co", (basis + change).astype(np.float32).ravel())
    block.slider_min, block.slider_max = low, high
