"""The render over the photo, by compositor nodes.

Cycles has shadow catchers: its render goes over the photo. For EEVEE the photo is multiplied by the surfaces with
objects divided by the surfaces without (Debevec 1998, differential rendering); `empty` makes the two other renders.
"""

import bpy

from . import empty
from .names import MADE, ROOM, part, photo

# Since 5.0, a scene's compositor is a node group, which other scenes can use.
HAS_GROUPS = bpy.app.version >= (5, 0, 0)
# Added to both sides of the ratio, which is 1 where there are no surfaces.
DARK = 1e-4
# The value of `MADE` for compositors. Their nodes have what they do.
COMPOSITOR = "compositor"
INPUT, OVER, OUTPUT = "input", "over", "output"
OUTPUT_NODE = "NodeGroupOutput" if HAS_GROUPS else "CompositorNodeComposite"
# The nodes that Blender gives to a new compositor before 5.0, one of each.
DEFAULT_NODES = {"CompositorNodeComposite", "CompositorNodeRLayers", "CompositorNodeViewer", "NodeReroute"}


def group_of(scene, collection):
    """Returns the node group of the room for the scene's engine and size. That of each engine is made if necessary."""
    room = collection.room_light
    if room.compositing is None:
        room.compositing = over_photo(collection.name, photo(collection))
    if room.shading is None:
        room.shading = shaded_photo(collection.name, photo(collection))
    for group in (room.compositing, room.shading):
        scale = photo_scale(group)
        if scale is not None:
            set_framing(scale, framing(scene, collection))
    return chosen(scene, room)


def chosen(scene, room):
    """Returns the node group for the scene's engine, or None."""
    return room.compositing if scene.render.engine == "CYCLES" else room.shading


def over_photo(name, photo):
    """Makes the node group that puts a render with alpha over the photo."""
    group = new_group(f"{name} Over Photo", ["Image"])
    nodes = Nodes(group)
    render = nodes.new("NodeGroupInput")
    over = nodes.new("CompositorNodeAlphaOver")
    below, above = (over.inputs[0], over.inputs[1]) if HAS_GROUPS else (over.inputs[1], over.inputs[2])
    nodes.link(nodes.photo(photo), below)
    nodes.link(render.outputs["Image"], above)
    nodes.link(over.outputs["Image"], nodes.new("NodeGroupOutput").inputs[0])
    return group


def shaded_photo(name, photo):
    """Makes the node group that shades the photo as the objects shade its surfaces, and adds the objects."""
    group = new_group(f"{name} Shaded Photo", ["Objects", "Alpha", "With", "Without"])
    nodes = Nodes(group)
    render = nodes.new("NodeGroupInput")
    objects, alpha = render.outputs["Objects"], render.outputs["Alpha"]
    uncovered = nodes.new("ShaderNodeMath")
    uncovered.operation = "SUBTRACT"
    uncovered.inputs[0].default_value = 1.0
    nodes.link(alpha, uncovered.inputs[1])
    little = nodes.new("ShaderNodeMath")
    little.operation = "MULTIPLY"
    little.inputs[0].default_value = DARK
    nodes.link(uncovered.outputs[0], little.inputs[1])
    # With and objects are both weighted by their coverage of the pixel, so that edges are exact.
    shaded = nodes.mix("ADD", nodes.mix("SUBTRACT", render.outputs["With"], objects), little.outputs[0])
    plain = nodes.mix("ADD", render.outputs["Without"], (DARK, DARK, DARK, 1.0))
    photo_shaded = nodes.mix("MULTIPLY", nodes.photo(photo), nodes.mix("DIVIDE", shaded, plain))
    nodes.link(nodes.mix("ADD", photo_shaded, objects), nodes.new("NodeGroupOutput").inputs[0])
    return group


def new_group(name, inputs):
    group = bpy.data.node_groups.new(name, "CompositorNodeTree")
    group[MADE] = ROOM
    for name in inputs:
        kind = "NodeSocketFloat" if name == "Alpha" else "NodeSocketColor"
        group.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    group.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return group


class Nodes:
    """Adds nodes to a tree from left to right."""

    def __init__(self, tree):
        self.tree = tree

    def new(self, kind):
        node = self.tree.nodes.new(kind)
        node.location = (200 * len(self.tree.nodes), 0)
        return node

    def link(self, output, input):
        self.tree.links.new(output, input)

    def photo(self, photo):
        """The photo, as wide or as high as the render."""
        image, scale = self.new("CompositorNodeImage"), self.new("CompositorNodeScale")
        image.image = photo
        if HAS_GROUPS:
            scale.inputs["Type"].default_value = "Render Size"
            scale.inputs["Extension X"].default_value = scale.inputs["Extension Y"].default_value = "Extend"
        else:
            scale.space = "RENDER_SIZE"
        self.link(image.outputs["Image"], scale.inputs["Image"])
        return scale.outputs["Image"]

    def mix(self, operation, first, second):
        node = self.new("ShaderNodeMix")
        node.data_type, node.blend_type, node.clamp_factor = "RGBA", operation, False
        by_name = {socket.identifier: socket for socket in node.inputs}
        by_name["Factor_Float"].default_value = 1.0
        self.link(first, by_name["A_Color"])
        if isinstance(second, tuple):
            by_name["B_Color"].default_value = second
        else:
            self.link(second, by_name["B_Color"])
        return next(socket for socket in node.outputs if socket.identifier == "Result_Color")

    def layer(self, scene, layer):
        node = self.new("CompositorNodeRLayers")
        node[MADE], node.scene, node.layer = INPUT, scene, layer.name
        return node.outputs


def framing(scene, collection):
    """Returns how the photo is brought to the render's size, as the camera is: its width or its height stays."""
    width, height = photo(collection).size
    is_wider = scene.render.resolution_x * height > scene.render.resolution_y * width
    fits_width = part(collection, "Camera").data.sensor_fit != "VERTICAL"
    return "CROP" if is_wider == fits_width else "FIT"


def photo_scale(group):
    """Returns the node that scales the photo, or None."""
    return next((node for node in group.nodes if node.bl_idname == "CompositorNodeScale"), None)


def set_framing(scale, framing):
    if HAS_GROUPS:
        scale.inputs["Frame Type"].default_value = framing.capitalize()
    else:
        scale.frame_method = framing


def get_framing(scale):
    return scale.inputs["Frame Type"].default_value.upper() if HAS_GROUPS else scale.frame_method


def connect(scene, collection):
    """Puts a room's group into the scene's compositor, in the place of the former room's. Nodes of the user stay.

    Returns what the user has to do.
    """
    group = group_of(scene, collection)
    if not is_free(scene):
        return [f"The scene has compositor nodes: put the node group {group.name!r} before the output"]
    scene.render.use_compositing = True
    tree = own_tree(scene)
    targets = remove_own(tree)
    nodes = Nodes(tree)
    over = nodes.new("CompositorNodeGroup")
    over.node_tree, over.label, over[MADE] = group, group.name, OVER
    own = nodes.layer(scene, empty.main_layer(scene))
    if group == collection.room_light.shading:
        objects = nodes.layer(scene, scene.view_layers[empty.OBJECTS])
        bare = collection.room_light.empty
        without = nodes.layer(bare, bare.view_layers[0])
        for output, name in [(objects["Image"], "Objects"), (objects["Alpha"], "Alpha"), (own["Image"], "With")]:
            nodes.link(output, over.inputs[name])
        nodes.link(without["Image"], over.inputs["Without"])
    else:
        nodes.link(own["Image"], over.inputs["Image"])
    if not targets:
        output = nodes.new(OUTPUT_NODE)
        output[MADE] = OUTPUT
        targets = [output.inputs[0]]
    for target in targets:
        nodes.link(over.outputs[0], target)
    return []


def disconnect(scene):
    """Removes a room's nodes from the scene's compositor, which is left without them only if the user added some."""
    if not is_rooms(scene):
        return
    tree = current(scene)
    targets = remove_own(tree)
    del tree[MADE]
    has_others = any(MADE not in node for node in tree.nodes)
    if not has_others and HAS_GROUPS:
        bpy.data.node_groups.remove(tree)
        return
    nodes = Nodes(tree)
    render = nodes.layer(scene, empty.main_layer(scene))
    for target in targets:
        nodes.link(render["Image"], target)
    for node in tree.nodes:
        if MADE in node:
            del node[MADE]
    if not has_others:
        scene.use_nodes = False


def remove_own(tree):
    """Removes a room's nodes but the output. Returns to what they were linked."""
    over, last = made(tree, OVER), made(tree, OUTPUT)
    # A node without its group has no sockets.
    targets = [link.to_socket for output in over.outputs for link in output.links] if over else []
    if not targets and last:
        targets = [last.inputs[0]]
    for node in [node for node in tree.nodes if node.get(MADE) in (INPUT, OVER)]:
        tree.nodes.remove(node)
    return targets


def made(tree, purpose):
    """Returns the room's node for a purpose, or None."""
    return next((node for node in tree.nodes if node.get(MADE) == purpose), None)


def own_tree(scene):
    """Returns the scene's compositor, which is made if necessary."""
    if is_rooms(scene):
        return current(scene)
    if HAS_GROUPS:
        tree = scene.compositing_node_group = new_group("Room Light", [])
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
    tree[MADE] = COMPOSITOR
    return tree


def is_free(scene):
    """Returns whether the scene has no compositor of the user."""
    tree = current(scene)
    if tree is None or is_rooms(scene):
        return True
    return not HAS_GROUPS and not scene.use_nodes and is_default(tree)


def is_default(tree):
    """Returns whether a compositor is as Blender makes it, before 5.0."""
    kinds = {node.bl_idname for node in tree.nodes}
    return len(kinds) == len(tree.nodes) and kinds <= DEFAULT_NODES


def is_rooms(scene):
    """Returns whether the compositor is a room's."""
    tree = current(scene)
    return tree is not None and tree.get(MADE) == COMPOSITOR


def current(scene):
    """Returns the scene's compositor, or None."""
    return scene.compositing_node_group if HAS_GROUPS else scene.node_tree


def is_current(scene, collection):
    """Returns whether the room's group is connected, and is the one for the scene's engine and size."""
    if not is_rooms(scene):
        return True
    group, over = chosen(scene, collection.room_light), made(current(scene), OVER)
    if group is None or over is None or over.node_tree != group:
        return False
    scale = photo_scale(group)
    return scale is None or get_framing(scale) == framing(scene, collection)
