"""Buttons."""

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras import view3d_utils
from bpy_extras.io_utils import ExportHelper, ImportHelper

from . import jobs, pairs
from .arrays import Refused, Surface


def settings(context):
    return context.scene.barymap


def refused(error):
    """The sentence of an error for the status bar; other errors are mistakes and go on."""
    import barymap

    if isinstance(error, (Refused, barymap.BarymapError)):
        return str(error)
    raise error


class Background:
    """An operator whose job works in the background, with a progress bar; Esc stops it. Without a
    window it works at once."""

    bl_options = {"REGISTER", "UNDO"}
    job_class = None

    def execute(self, context):
        try:
            job = self.job_class(settings(context))
            job.run()
            self.report({"INFO"}, job.finish())
        except Exception as error:  # noqa: BLE001: those that are no sentence are raised again
            self.report({"ERROR"}, refused(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context, event):
        try:
            self.job = self.job_class(settings(context))
        except Exception as error:  # noqa: BLE001
            self.report({"ERROR"}, refused(error))
            return {"CANCELLED"}
        self.thread = self.job.start()
        manager = context.window_manager
        self.timer = manager.event_timer_add(0.1, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.job.stopped = True
            context.workspace.status_text_set("barymap: stopping ...")
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self.thread.is_alive():
            stage, done, total = self.job.told
            share = 100 * done / total if total else 0
            context.window_manager.progress_update(share)
            if not self.job.stopped:
                context.workspace.status_text_set(f"barymap: {self.job.title}, {stage} {share:.0f} %   |   Esc: stop")
            return {"RUNNING_MODAL"}
        manager = context.window_manager
        manager.event_timer_remove(self.timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        try:
            self.report({"INFO"}, self.job.finish())
        except Exception as error:  # noqa: BLE001
            self.report({"WARNING" if self.job.stopped else "ERROR"}, refused(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class BARYMAP_OT_textures(Background, bpy.types.Operator):
    """Textures of the source's material as new images in a new material of the target"""

    bl_idname, bl_label, job_class = "barymap.textures", "Textures", jobs.Textures


class BARYMAP_OT_weights(Background, bpy.types.Operator):
    """Vertex groups of the source on the target"""

    bl_idname, bl_label, job_class = "barymap.weights", "Vertex Groups", jobs.Weights


class BARYMAP_OT_colors(Background, bpy.types.Operator):
    """The active colour attribute of the source on the target"""

    bl_idname, bl_label, job_class = "barymap.colors", "Colours", jobs.Colors


class BARYMAP_OT_shape_keys(Background, bpy.types.Operator):
    """Shape keys of the source on the target"""

    bl_idname, bl_label, job_class = "barymap.shape_keys", "Shape Keys", jobs.ShapeKeys


class BARYMAP_OT_coverage(Background, bpy.types.Operator):
    """How far the map is to be trusted, as a colour attribute of the target: white valid, yellow doubtful, red failed"""

    bl_idname, bl_label, job_class = "barymap.coverage", "Coverage", jobs.Coverage


class BARYMAP_OT_suggest(Background, bpy.types.Operator):
    """Ghosts where further pairs would help most; pairs that contradict the others are named"""

    bl_idname, bl_label, job_class = "barymap.suggest", "Suggest Pairs", jobs.Suggested


class At:
    """An operator that is done at once."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            self.report({"INFO"}, self.act(context, settings(context)))
        except Exception as error:  # noqa: BLE001
            self.report({"ERROR"}, refused(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def both(chosen):
    if chosen.source is None or chosen.target is None or chosen.source == chosen.target:
        raise Refused("Choose a mesh as source and another one as target")
    return chosen.source, chosen.target


class BARYMAP_OT_mirror(At, bpy.types.Operator):
    """The mirror image of each pair, in the objects' own x"""

    bl_idname, bl_label = "barymap.mirror", "Mirror Pairs"

    def act(self, context, chosen):
        return f"{pairs.mirror(context, *both(chosen))} pairs added"


class BARYMAP_OT_from_groups(At, bpy.types.Operator):
    """A pair for each vertex group that both objects have"""

    bl_idname, bl_label = "barymap.from_groups", "From Vertex Groups"

    def act(self, context, chosen):
        return f"{pairs.from_groups(context, *both(chosen))} pairs added"


class BARYMAP_OT_snap(At, bpy.types.Operator):
    """Moves all points back onto their surfaces"""

    bl_idname, bl_label = "barymap.snap", "Snap to Surface"

    def act(self, context, chosen):
        return f"{pairs.snap(context)} points on their surfaces"


class BARYMAP_OT_keep_ghosts(At, bpy.types.Operator):
    """Makes pairs of the suggested places, to be corrected by hand"""

    bl_idname, bl_label = "barymap.keep_ghosts", "Keep Suggestions"

    def act(self, context, chosen):
        return f"{pairs.keep_ghosts(context, *both(chosen))} pairs added"


class BARYMAP_OT_clear(At, bpy.types.Operator):
    """Removes all pairs, or the suggestions alone"""

    bl_idname, bl_label = "barymap.clear", "Remove Pairs"
    ghosts: BoolProperty(name="Suggestions alone")

    def act(self, context, chosen):
        pairs.remove(self.ghosts)
        return "Removed"


class BARYMAP_OT_read_pairs(At, bpy.types.Operator, ImportHelper):
    """Reads pairs: JSON or lines of two vertices, as the command line has them; positions are of the world"""

    bl_idname, bl_label, filename_ext = "barymap.read_pairs", "Read Pairs", ".json"
    filter_glob: StringProperty(default="*.json;*.txt", options={"HIDDEN"})

    def act(self, context, chosen):
        source, target = both(chosen)
        surfaces = [Surface(source, False), Surface(target, False)]
        return f"{pairs.from_file(context, source, target, self.filepath, surfaces)} pairs read"


class BARYMAP_OT_write_pairs(At, bpy.types.Operator, ExportHelper):
    """Writes the pairs as the command line reads them: positions in the world"""

    bl_idname, bl_label, filename_ext = "barymap.write_pairs", "Write Pairs", ".json"

    def act(self, context, chosen):
        pairs.write(self.filepath)
        return f"{len(pairs.complete())} pairs written"


def under(obj, origin, direction):
    """Where a ray of the world meets an object, or None."""
    seen = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    inverse = seen.matrix_world.inverted()
    near = inverse @ origin
    hit, at, _, _ = seen.ray_cast(near, (inverse.to_3x3() @ direction).normalized())
    return seen.matrix_world @ at if hit else None


class BARYMAP_OT_pick(bpy.types.Operator):
    """Click a point of the source, then the point of the target that corresponds to it, and so on; Esc or right click ends"""

    bl_idname, bl_label, bl_options = "barymap.pick", "Click Pairs", {"REGISTER", "UNDO"}

    def invoke(self, context, event):
        try:
            both(settings(context))
        except Refused as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if context.space_data is None or context.space_data.type != "VIEW_3D":
            self.report({"ERROR"}, "Click in a 3D view")
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        self.tell(context)
        return {"RUNNING_MODAL"}

    def tell(self, context):
        side = self.side()
        number = pairs.next_number(side)
        context.workspace.status_text_set(f"barymap: pair {number}, click on the {side}   |   Esc: done")

    def side(self):
        halves = [set(pair) for pair in pairs.empties().values() if len(pair) == 1]
        return "target" if {"source"} in halves else "source"

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE", "RET"} and event.value == "PRESS":
            context.workspace.status_text_set(None)
            return {"FINISHED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        region, view = context.region, context.region_data
        inside = 0 <= event.mouse_region_x < region.width and 0 <= event.mouse_region_y < region.height
        if not inside or view is None:
            return {"PASS_THROUGH"}
        at = (event.mouse_region_x, event.mouse_region_y)
        side, chosen = self.side(), settings(context)
        obj = getattr(chosen, side)
        origin = view3d_utils.region_2d_to_origin_3d(region, view, at)
        point = under(obj, origin, view3d_utils.region_2d_to_vector_3d(region, view, at))
        if point is None:
            self.report({"WARNING"}, f"That is not on {obj.name}, the {side}")
        else:
            pairs.place(context, obj, side, point)
        self.tell(context)
        return {"RUNNING_MODAL"}


CLASSES = [
    BARYMAP_OT_textures,
    BARYMAP_OT_weights,
    BARYMAP_OT_colors,
    BARYMAP_OT_shape_keys,
    BARYMAP_OT_coverage,
    BARYMAP_OT_suggest,
    BARYMAP_OT_mirror,
    BARYMAP_OT_from_groups,
    BARYMAP_OT_snap,
    BARYMAP_OT_keep_ghosts,
    BARYMAP_OT_clear,
    BARYMAP_OT_read_pairs,
    BARYMAP_OT_write_pairs,
    BARYMAP_OT_pick,
]
