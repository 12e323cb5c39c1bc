# A skinned, morphing strip with a moving child, exported by Blender, and its vertices per time as Blender evaluates them.
import bpy, json, math
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 24
import bmesh
mesh = bpy.data.meshes.new("strip"); bm = bmesh.new()
rows = []
for i in range(5):
    rows.append([bm.verts.new((x, y, 0.5 * i)) for x, y in [(-0.2, -0.1), (0.2, -0.1), (0.2, 0.15), (-0.2, 0.1)]])
for a, b in zip(rows, rows[1:]):
    for k in range(4):
        bm.faces.new([a[k], a[(k + 1) % 4], b[(k + 1) % 4], b[k]])
bm.to_mesh(mesh); bm.free()
strip = bpy.data.objects.new("strip", mesh); scene.collection.objects.link(strip)
strip.shape_key_add(name="Basis"); key = strip.shape_key_add(name="wide"); 
for i, v in enumerate(mesh.vertices):
    key.data[i].co = (v.co.x * 1.5, v.co.y + 0.1 * v.co.z, v.co.z)
arm = bpy.data.armatures.new("arm"); rig = bpy.data.objects.new("rig", arm); scene.collection.objects.link(rig)
bpy.context.view_layer.objects.active = rig
bpy.ops.object.mode_set(mode="EDIT")
lower = arm.edit_bones.new("lower"); lower.head, lower.tail = (0, 0, 0), (0, 0, 1)
upper = arm.edit_bones.new("upper"); upper.head, upper.tail = (0, 0, 1), (0, 0, 2); upper.parent = lower; upper.use_connect = True
bpy.ops.object.mode_set(mode="OBJECT")
strip.parent = rig
mod = strip.modifiers.new("arm", "ARMATURE"); mod.object = rig
for name, f in [("lower", lambda z: max(0, min(1, (1.6 - z) / 1.2))), ("upper", lambda z: 1 - max(0, min(1, (1.6 - z) / 1.2)))]:
    g = strip.vertex_groups.new(name=name)
    for v in mesh.vertices:
        if f(v.co.z) > 0: g.add([v.index], f(v.co.z), "REPLACE")
rig.rotation_euler = (0.1, 0, 0.4); rig.location = (0.3, -0.2, 0.1)
bone = rig.pose.bones["upper"]; bone.rotation_mode = "XYZ"
for f, a in [(1, 0.0), (13, 1.1), (25, -0.4)]:
    bone.rotation_euler = (a, 0.2 * a, 0.3 * a); bone.keyframe_insert("rotation_euler", frame=f)
low = rig.pose.bones["lower"]; low.rotation_mode = "QUATERNION"
for f, a in [(1, 0.0), (25, 0.6)]:
    low.rotation_quaternion = (math.cos(a / 2), 0, math.sin(a / 2), 0); low.keyframe_insert("rotation_quaternion", frame=f)
    low.location = (0.1 * a, 0, 0.2 * a); low.keyframe_insert("location", frame=f)
rig.animation_data.action.name = "Bend"
for f, w in [(1, 0.0), (13, 1.0), (25, 0.25)]:
    key.value = w; key.keyframe_insert("value", frame=f)
mesh.shape_keys.animation_data.action.name = "Bend shapes"
scene.frame_start, scene.frame_end = 1, 25
bpy.ops.export_scene.gltf(filepath="bend.glb", export_animations=True, export_animation_mode="SCENE", export_force_sampling=True, export_frame_range=True, export_morph_normal=False, export_yup=True)
out = {}
for f in [1, 5, 8, 13, 20, 25]:
    scene.frame_set(f)
    dg = bpy.context.evaluated_depsgraph_get(); ev = strip.evaluated_get(dg); m = ev.to_mesh()
    pts = [ev.matrix_world @ v.co for v in m.vertices]
    out[str(f - 1)] = sorted([round(p.x, 5), round(p.z, 5), round(-p.y, 5)] for p in pts)
json.dump(out, open("bend.json", "w"))
