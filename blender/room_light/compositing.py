"""The render over the photo, by compositor nodes.

Cycles has shadow catchers: its render goes over the photo. For EEVEE the photo is multiplied by the surfaces with
objects divided by the surfaces without (Debevec 1998, differential rendering); `empty` makes the two other renders.
"""

import bpy

from . import empty
from .names import COMPOSITOR

# Since 5.0, a scene's compositor is a node group, which other scenes can use.
HAS_GROUPS = bpy.app.version >= (5, 0, 0)
# Added to both sides of the ratio, which is 1 where there are no surfaces.
DARK = 1e-4


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
        """The photo at the render's size."""
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

    def render(self, scene, layer):
        node = self.new("CompositorNodeRLayers")
        node.scene, node.layer = scene, layer
        return node.outputs


def connect(scene, room):
    """Makes a room's group the scene's compositor. Returns the group, and whether the compositor was free."""
    is_eevee = scene.render.engine != "CYCLES"
    group = room.shading if is_eevee else room.compositing
    if not is_free(scene):
        return group, False
    scene.render.use_compositing = True
    tree = own_tree(scene)
    tree.nodes.clear()
    nodes = Nodes(tree)
    own = nodes.render(scene, empty.main_layer(scene).name)
    over = nodes.new("CompositorNodeGroup")
    over.node_tree = group
    over.label = group.name
    if is_eevee:
        objects = nodes.render(scene, empty.OBJECTS)
        without = nodes.render(room.empty, room.empty.view_layers[0].name)
        for output, name in [(objects["Image"], "Objects"), (objects["Alpha"], "Alpha"), (own["Image"], "With")]:
            nodes.link(output, over.inputs[name])
        nodes.link(without["Image"], over.inputs["Without"])
    else:
        nodes.link(own["Image"], over.inputs["Image"])
    output = nodes.new("NodeGroupOutput" if HAS_GROUPS else "CompositorNodeComposite")
    nodes.link(over.outputs[0], output.inputs[0])
    return group, True


def disconnect(scene):
    """Leaves the scene without compositor if it is a room's."""
    if not is_rooms(scene):
        return
    if HAS_GROUPS:
        tree, scene.compositing_node_group = scene.compositing_node_group, None
        bpy.data.node_groups.remove(tree)
    else:
        scene.node_tree.nodes.clear()
        del scene.node_tree[COMPOSITOR]
        scene.use_nodes = False


def own_tree(scene):
    """Returns the scene's compositor, which is made if necessary."""
    if not HAS_GROUPS:
        scene.use_nodes = True
        scene.node_tree[COMPOSITOR] = True
        return scene.node_tree
    if scene.compositing_node_group is None:
        tree = new_group("Room Light", [])
        tree[COMPOSITOR] = True
        scene.compositing_node_group = tree
    return scene.compositing_node_group


def is_free(scene):
    return current(scene) is None or is_rooms(scene)


def is_rooms(scene):
    """Returns whether the compositor is a room's."""
    tree = current(scene)
    return tree is not None and bool(tree.get(COMPOSITOR))


def current(scene):
    """Returns the scene's compositor, if it has one in use."""
    if HAS_GROUPS:
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def is_for_cycles(scene, room):
    """Returns whether the compositor puts a render of Cycles over the photo."""
    tree = current(scene)
    groups = [node.node_tree for node in tree.nodes if node.bl_idname == "CompositorNodeGroup"] if tree else []
    return room.shading not in groups
