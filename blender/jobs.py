"""Work in the background: what it needs is read first, in Blender's main thread; the work itself
touches arrays alone, in a thread of its own; its result is put into Blender's data at the end.

Each job is a class with three methods of those names.
"""

import hashlib
import threading

import numpy as np

from . import arrays, pairs
from .arrays import Refused, Surface

#: Inputs of the Principled shader that a texture may be linked to, and the role each is.
ROLES = {
    "Base Color": "base_color",
    "Metallic": "metallic",
    "Roughness": "roughness",
    "Normal": "normal",
    "Alpha": "opacity",
    "Emission Color": "emissive",
    "Specular IOR Level": "specular",
}


#: The last map, and what it was made of.
_last = {}


class Stopped(Exception):
    """The user pressed Esc."""


class Job:
    """A map between the two objects, and what is carried along it."""

    #: Whether vertices have to be those of the objects' own data.
    own_vertices = True
    #: What is told while it works.
    title = "Mapping"

    def __init__(self, settings):
        self.source, self.target = settings.source, settings.target
        if self.source is not None and self.source == self.target:
            raise Refused("Source and target are the same object: choose two")
        self.surfaces = [Surface(obj, self.own_vertices) for obj in (self.source, self.target)]
        self.anchors = self.read_anchors()
        self.method, self.landmarks = settings.method, settings.landmarks
        self.told, self.stopped = (self.title, 0, 0), False
        self.result = self.error = None
        self.read(settings)

    def read_anchors(self):
        """The pairs in the world."""
        return pairs.positions()

    def progress(self, stage, done, total):
        """Hears how far the work is; raises where it is to stop."""
        self.told = (stage, done, total)
        if self.stopped:
            raise Stopped

    def map(self):
        """The map: that of the button before, where meshes and pairs are as they were."""
        import barymap

        key = hashlib.blake2b(repr((self.method, self.landmarks)).encode())
        for surface in self.surfaces:
            uv = np.zeros(0) if surface.uv is None else surface.uv
            for values in (surface.vertices, surface.faces, uv):
                key.update(repr(values.shape).encode() + np.ascontiguousarray(values).tobytes())
        for points in self.anchors:
            key.update(points.tobytes())
        if _last.get("key") != key.digest():
            made = barymap.Map(
                self.surfaces[0].mesh(),
                self.surfaces[1].mesh(),
                self.anchors,
                method=self.method,
                landmarks=self.landmarks,
                progress=self.progress,
            )
            _last.update(key=key.digest(), map=made)
        return _last["map"]

    def run(self):
        """Works, and keeps what came of it."""
        try:
            self.result = self.work()
        except Exception as error:  # noqa: BLE001: it is raised in the main thread
            self.error = error

    def start(self):
        """Works in the background; returns the thread."""
        thread = threading.Thread(target=self.run, name="barymap", daemon=True)
        thread.start()
        return thread

    def finish(self):
        """Puts the result into Blender's data; returns a sentence about it."""
        if isinstance(self.error, Stopped):
            raise Refused("Stopped")
        if self.error is not None:
            raise self.error
        return self.put(self.result)

    def read(self, settings):
        """Reads what is carried."""

    def work(self):
        """Works on arrays alone."""
        raise NotImplementedError

    def put(self, result):
        """Puts the result into Blender's data; returns a sentence about it."""
        raise NotImplementedError


def texture_nodes(material):
    """The image nodes of a material by the input of its Principled shader that they lead to."""
    found = {}
    if material is None or not material.use_nodes:
        return found
    for node in material.node_tree.nodes:
        if node.type != "BSDF_PRINCIPLED":
            continue
        for socket in node.inputs:
            role = ROLES.get(socket.name)
            image = _image_behind(socket) if role else None
            if image is not None:
                found.setdefault(role, image)
    return found


def _image_behind(socket, depth=0):
    """The image node that a socket is linked to, through other nodes."""
    if depth > 8:
        return None
    for link in socket.links:
        node = link.from_node
        if node.type == "TEX_IMAGE" and node.image is not None:
            return node
        for inner in node.inputs:
            found = _image_behind(inner, depth + 1)
            if found is not None:
                return found
    return None


class Textures(Job):
    """All textures of the source's material, as new images in a new material of the target."""

    own_vertices = False
    title = "Textures"

    def read(self, settings):
        self.material = self.source.active_material
        nodes = texture_nodes(self.material)
        if not nodes:
            raise Refused(f"The active material of {self.source.name} has no image texture in a Principled shader")
        for surface in self.surfaces:
            if surface.uv is None:
                raise Refused(f"{surface.name} has no UV map: unwrap it first")
        self.images = {role: node.image for role, node in nodes.items()}
        self.nodes = {role: node.name for role, node in nodes.items()}
        self.pictures = {role: arrays.picture(image) for role, image in self.images.items()}
        self.options = {"size": settings.size, "margin": settings.margin, "fill": settings.fill}

    def work(self):
        return self.map().transfer(self.pictures, progress=self.progress, **self.options)

    def put(self, result):
        material = self.material.copy()
        material.name = f"{self.target.name} from {self.source.name}"
        for role, pixels in result.items():
            image = arrays.new_image(f"{self.target.name} {role}", pixels, self.images[role])
            material.node_tree.nodes[self.nodes[role]].image = image
        self.target.data.materials.clear()
        self.target.data.materials.append(material)
        share = 100 * result.valid_fraction
        return f"{len(result)} textures, {share:.1f} % of the surface vouched for"


class Weights(Job):
    """The vertex groups of the source."""

    title = "Vertex groups"

    def read(self, settings):
        self.names, self.table = arrays.weights(self.source)
        if not self.names:
            raise Refused(f"{self.source.name} has no vertex groups")

    def work(self):
        return self.map().transfer_attributes(self.table, kind="scalars", progress=self.progress)

    def put(self, result):
        arrays.set_weights(self.target, self.names, np.nan_to_num(np.clip(result.values, 0, 1)))
        return f"{len(self.names)} vertex groups{_doubtful(result.status)}"


class Colors(Job):
    """The active colour attribute of the source."""

    title = "Colours"

    def read(self, settings):
        attribute = self.source.data.color_attributes.active_color
        if attribute is None:
            raise Refused(f"{self.source.name} has no colour attribute")
        self.name, self.table = attribute.name, arrays.colors(self.source, attribute)

    def work(self):
        return self.map().transfer_attributes(self.table, kind="colors", progress=self.progress)

    def put(self, result):
        arrays.set_colors(self.target, self.name, np.nan_to_num(result.values))
        return f"Colours {self.name}{_doubtful(result.status)}"


class ShapeKeys(Job):
    """The shape keys of the source: their changes turn as the surface does."""

    title = "Shape keys"

    def read(self, settings):
        self.keys = arrays.shape_keys(self.source)
        self.table = np.hstack([self.surfaces[0].to_world(change) for _, change, _, _ in self.keys])

    def work(self):
        return self.map().transfer_attributes(self.table, kind="vectors", progress=self.progress)

    def put(self, result):
        for k, (name, _, low, high) in enumerate(self.keys):
            change = np.nan_to_num(result.values[:, 3 * k : 3 * k + 3])
            arrays.set_shape_key(self.target, name, self.surfaces[1].to_object(change), low, high)
        return f"{len(self.keys)} shape keys{_doubtful(result.status)}"


class Coverage(Job):
    """How far the map is to be trusted, as a colour attribute of the target."""

    title = "Coverage"
    #: Colours by status: failed, doubtful, valid.
    palette = np.array([[0.6, 0.05, 0.05, 1], [0.9, 0.6, 0.1, 1], [1, 1, 1, 1]])
    attribute = "barymap coverage"

    def work(self):
        return self.map().vertices()

    def put(self, result):
        attribute = arrays.set_colors(self.target, self.attribute, self.palette[result.status])
        self.target.data.color_attributes.active_color = attribute
        share = 100 * float(np.mean(result.status == 2))
        return f"{share:.1f} % of the vertices vouched for"


class Suggested(Job):
    """Places where a pair would help most, as ghosts."""

    own_vertices = False
    title = "Suggestions"

    def read(self, settings):
        self.count = settings.suggestions

    def work(self):
        import barymap

        meshes = [surface.mesh() for surface in self.surfaces]
        # The pairs are those that are there; what is proposed beside them is not asked for.
        return barymap.anchors(
            *meshes, self.anchors, check=True, suggest=self.count, landmarks=self.landmarks, progress=self.progress
        )

    def put(self, result):
        import bpy

        pairs.remove(ghosts=True)
        places = [(s["source"], s["target"]["vertex"]) for s in result.report["suggestions"] if s["source"]]
        on_source = [s["position"] for s, _ in places]
        on_target = [self.surfaces[1].vertices[v] for _, v in places]
        pairs.add(bpy.context, self.source, self.target, on_source, on_target, ghost=True)
        wrong = [o["pair"] for o in result.report["outliers"]]
        numbers = pairs.complete()
        doubt = f"; pairs that the others contradict: {', '.join(str(numbers[k]) for k in wrong)}" if wrong else ""
        return f"{len(places)} places{doubt}"


def _doubtful(status):
    share = 100 * float(np.mean(np.asarray(status) < 2))
    return f", {share:.1f} % of the vertices doubtful" if share else ""
