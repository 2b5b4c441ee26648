"""Pairs of points: two empties of one number, children of their objects."""

import json

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .arrays import Refused

NUMBER, SIDE, GHOST = "barymap_pair", "barymap_side", "barymap_ghost"
SIDES = ("source", "target")


def empties(ghosts=False):
    """All empties of pairs: {number: {side: empty}}."""
    found = {}
    for obj in bpy.context.scene.objects:
        if NUMBER in obj and bool(obj.get(GHOST, False)) == ghosts:
            found.setdefault(int(obj[NUMBER]), {})[obj[SIDE]] = obj
    return dict(sorted(found.items()))


def complete(ghosts=False):
    """Numbers of the pairs that have both points."""
    return [k for k, pair in empties(ghosts).items() if set(pair) == set(SIDES)]


def next_number(side):
    """The lowest number whose point on this side is missing, halves first."""
    found = empties()
    halves = [k for k, pair in found.items() if side not in pair]
    return halves[0] if halves else max(found, default=-1) + 1


def place(context, obj, side, point, number=None, ghost=False):
    """Sets a point of a pair on an object, at a place of the world; a point that is there moves."""
    if obj is None:
        raise Refused(f"Choose the {side} first")
    number = next_number(side) if number is None else number
    empty = empties(ghost).get(number, {}).get(side)
    if empty is None:
        empty = bpy.data.objects.new(f"{'ghost' if ghost else 'pair'} {number:02} {side}", None)
        context.scene.collection.objects.link(empty)
        empty[NUMBER], empty[SIDE] = number, side
        if ghost:
            empty[GHOST] = True
        empty.empty_display_type = "CIRCLE" if ghost else "SPHERE"
        empty.show_name = empty.show_in_front = True
    extent = max(obj.dimensions) or 1.0
    empty.empty_display_size = 0.012 * extent
    at, corners = on_surface(obj, Vector(point))
    # It goes where the surface goes, also under bones and shape keys.
    empty.parent = obj
    empty.parent_type = "VERTEX_3" if corners else "OBJECT"
    if corners:
        empty.parent_vertices = corners
    empty.matrix_parent_inverse.identity()
    empty.location = empty.rotation_euler = (0, 0, 0)
    empty.scale = (1, 1, 1)
    context.view_layer.update()
    # The frame of its parent, as Blender sees it, without the object's scale from here on.
    frame = empty.matrix_world.copy()
    empty.matrix_parent_inverse = frame.inverted() @ Matrix.Translation(at)
    return empty


def on_surface(obj, point):
    """The point of the object's surface, with its modifiers, that is closest to a place of the
    world, and three vertices of the face that it lies on; none where modifiers change the
    vertices."""
    bpy.context.view_layer.update()
    seen = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = seen.matrix_world
    found, at, _, face = seen.closest_point_on_mesh(matrix.inverted() @ point)
    if not found:
        return point, None
    same = len(seen.data.vertices) == len(obj.data.vertices) and len(seen.data.polygons) == len(obj.data.polygons)
    corners = list(obj.data.polygons[face].vertices)[:3] if same and 0 <= face < len(obj.data.polygons) else None
    return matrix @ at, corners


def snap(context):
    """Moves all points back onto their surfaces; returns how many."""
    context.view_layer.update()
    count = 0
    for number, pair in empties().items():
        for side, empty in pair.items():
            if empty.parent is not None:
                place(context, empty.parent, side, empty.matrix_world.translation.copy(), number)
                count += 1
    return count


def remove(ghosts=False):
    """Removes all pairs, or all ghosts."""
    for pair in empties(ghosts).values():
        for empty in pair.values():
            bpy.data.objects.remove(empty)


def positions():
    """The places of complete pairs in the world: (k, 3) on the source, (k, 3) on the target."""
    bpy.context.view_layer.update()
    found = empties()
    numbers = complete()
    if not numbers:
        raise Refused("There are no pairs: click some, or read them from a file")
    at = lambda side: np.array([found[k][side].matrix_world.translation for k in numbers], np.float64)
    return at("source"), at("target")


def from_groups(context, source, target):
    """A pair for each vertex group that both objects have: at the mean place of its vertices."""
    shared = [g.name for g in source.vertex_groups if g.name in target.vertex_groups]
    count = 0
    for name in shared:
        places = [_mean(obj, obj.vertex_groups[name].index) for obj in (source, target)]
        if all(p is not None for p in places):
            number = max(empties(), default=-1) + 1
            for obj, side, at in zip((source, target), SIDES, places):
                place(context, obj, side, at, number)
            count += 1
    if count == 0:
        raise Refused("The objects have no vertex groups of the same names with vertices in them")
    return count


def _mean(obj, index):
    sums, total = Vector((0, 0, 0)), 0.0
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.group == index and element.weight > 0:
                sums += element.weight * vertex.co
                total += element.weight
    return obj.matrix_world @ (sums / total) if total > 0 else None


def mirror(context, source, target):
    """Adds the mirror image of each pair, in the objects' own x; those in the middle stay single."""
    context.view_layer.update()
    known = [pair for pair in empties().values() if set(pair) == set(SIDES)]
    count = 0
    for pair in known:
        reflected = []
        for side, obj in zip(SIDES, (source, target)):
            local = obj.matrix_world.inverted() @ pair[side].matrix_world.translation
            reflected.append((obj, side, Vector((-local.x, local.y, local.z)), abs(local.x)))
        if all(x < 0.01 * max(obj.dimensions) for obj, _, _, x in reflected):
            continue
        number = max(empties(), default=-1) + 1
        for obj, side, local, _ in reflected:
            place(context, obj, side, obj.matrix_world @ local, number)
        count += 1
    return count


def add(context, source, target, on_source, on_target, ghost=False):
    """Adds pairs at places of the world."""
    first = max(empties(ghost), default=-1) + 1
    for k, (s, t) in enumerate(zip(on_source, on_target)):
        place(context, source, "source", s, first + k, ghost)
        place(context, target, "target", t, first + k, ghost)


def keep_ghosts(context, source, target):
    """Makes pairs of the ghosts."""
    context.view_layer.update()
    found = empties(ghosts=True)
    numbers = complete(ghosts=True)
    at = lambda side: [found[k][side].matrix_world.translation.copy() for k in numbers]
    places = at("source"), at("target")
    remove(ghosts=True)
    add(context, source, target, *places)
    return len(numbers)


def write(path):
    """Writes the pairs as the command line reads them, by position in the world."""
    both = dict(zip(SIDES, positions()))
    text = {side: [{"position": p.tolist()} for p in both[side]] for side in SIDES}
    with open(path, "w", encoding="utf-8") as file:
        json.dump(text, file, indent=1)


def from_file(context, source, target, path, surfaces):
    """Adds the pairs of a file as the command line has them: vertices, points of faces, positions
    in the world; or lines of two vertices. ``surfaces`` are the objects as arrays."""
    try:
        with open(path, encoding="utf-8-sig") as file:
            text = file.read()
        if text.lstrip().startswith("{"):
            value = json.loads(text)
            lists = [value[side] for side in SIDES]
        else:
            rows = [line.split("#")[0].split() for line in text.splitlines()]
            lists = [[int(row[k]) for row in rows if row] for k in (0, 1)]
        places = [[_written(entry, surface) for entry in entries] for entries, surface in zip(lists, surfaces)]
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}") from None
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise Refused(f"{path}: these are no pairs of these meshes ({error})") from None
    if len(places[0]) != len(places[1]) or not places[0]:
        raise Refused(f"{path}: {len(places[0])} points of the source and {len(places[1])} of the target")
    add(context, source, target, *places)
    return len(places[0])


def _written(entry, surface):
    if isinstance(entry, dict) and "position" in entry:
        return Vector(entry["position"])
    if isinstance(entry, dict) and "face" in entry:
        if not 0 <= entry["face"] < len(surface.faces):
            raise IndexError(f"there is no face {entry['face']}")
        corners = surface.vertices[surface.faces[entry["face"]]]
        return Vector(np.asarray(entry["barycentric"], float) @ corners)
    vertex = entry["vertex"] if isinstance(entry, dict) else entry
    if not 0 <= vertex < len(surface.vertices):
        raise IndexError(f"there is no vertex {vertex}")
    return Vector(surface.vertices[vertex])
