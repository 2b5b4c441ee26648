"""barymap in Blender: textures, weights, colours and shape keys onto another mesh, from pairs of
points. The panel is in the sidebar of the 3D view."""

import bpy
from bpy.props import EnumProperty, IntProperty, PointerProperty

from . import operators, pairs


def _is_mesh(_, obj):
    return obj.type == "MESH"


class BarymapSettings(bpy.types.PropertyGroup):
    """What the panel asks for."""

    source: PointerProperty(type=bpy.types.Object, poll=_is_mesh, name="Source", description="The mesh that gives")
    target: PointerProperty(type=bpy.types.Object, poll=_is_mesh, name="Target", description="The mesh that receives")
    method: EnumProperty(
        name="Method",
        items=[
            ("field", "Field", "An image for every vertex, predicted on the surface and in space"),
            ("averages", "Averages", "Weighted averages of the pairs on the surface"),
            ("transport", "Transport", "Averages with the residual carried over"),
            ("rbf", "Radial", "Radial basis functions in space, then the closest point"),
            ("closest", "Closest", "Alignment by the pairs, then the closest point"),
        ],
    )
    landmarks: IntProperty(name="Landmarks", default=2000, min=4, max=5000)
    size: IntProperty(name="Size", description="Side of new textures, in pixels", default=2048, min=16, max=16384)
    margin: IntProperty(name="Margin", description="Pixels of padding around charts", default=16, min=0, max=256)
    fill: EnumProperty(
        name="Fill",
        description="What parts get that the map leaves without colour",
        items=[(word, word.capitalize(), "") for word in ("none", "smooth", "pull-push", "nearest")],
    )
    suggestions: IntProperty(name="Places", default=5, min=1, max=100)


class BARYMAP_PT_panel(bpy.types.Panel):
    """The panel."""

    bl_label, bl_idname = "barymap", "BARYMAP_PT_panel"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "barymap"

    def draw(self, context):
        chosen, layout = context.scene.barymap, self.layout
        column = layout.column()
        column.prop(chosen, "source")
        column.prop(chosen, "target")
        found = pairs.empties()
        whole = sum(len(pair) == 2 for pair in found.values())
        half = len(found) - whole
        box = layout.box()
        box.label(text=f"{whole} pairs" + (f", {half} half" if half else ""), icon="EMPTY_AXIS")
        box.operator("barymap.pick", icon="RESTRICT_SELECT_OFF")
        row = box.row(align=True)
        row.operator("barymap.mirror", icon="MOD_MIRROR")
        row.operator("barymap.snap", icon="SNAP_ON")
        row = box.row(align=True)
        row.operator("barymap.read_pairs", icon="IMPORT")
        row.operator("barymap.write_pairs", icon="EXPORT")
        box.operator("barymap.from_groups", icon="GROUP_VERTEX")
        row = box.row(align=True)
        row.operator("barymap.suggest", icon="GHOST_ENABLED")
        row.prop(chosen, "suggestions", text="")
        row = box.row(align=True)
        row.operator("barymap.keep_ghosts", icon="CHECKMARK")
        row.operator("barymap.clear", icon="TRASH")
        box = layout.box()
        box.prop(chosen, "method")
        box.prop(chosen, "landmarks")
        box = layout.box()
        for name, icon in [
            ("textures", "TEXTURE"),
            ("weights", "GROUP_VERTEX"),
            ("colors", "COLOR"),
            ("shape_keys", "SHAPEKEY_DATA"),
            ("coverage", "OVERLAY"),
        ]:
            box.operator(f"barymap.{name}", icon=icon)
        row = box.row(align=True)
        row.prop(chosen, "size")
        row.prop(chosen, "margin")
        box.prop(chosen, "fill")


CLASSES = [BarymapSettings, *operators.CLASSES, BARYMAP_PT_panel]


def register():
    """Called by Blender when the extension is switched on."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.barymap = PointerProperty(type=BarymapSettings)


def unregister():
    """Called by Blender when it is switched off."""
    del bpy.types.Scene.barymap
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
