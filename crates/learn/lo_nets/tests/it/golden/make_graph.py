"""Writes graph.safetensors: residual block, pooling and the heads' MLP on a small dual graph, by `ognn` (DualOctreeGNN's first author).

Needs the environment of the peers' benchmark (ocnn 2.3.3, ognn, torch) and safetensors. Run beside this file.
"""

import ocnn
import ognn
import torch
from safetensors.torch import save_file

torch.manual_seed(6)
DEPTH, FULL_DEPTH, FINE, COARSE, BETWEEN, HIDDEN = 5, 2, 8, 12, 4, 6
points = torch.rand(90, 3) * 2 - 1
points[:, 1] = 0.3 * points[:, 0] - 0.05  # a slanted sheet
octree = ocnn.octree.Octree(DEPTH, FULL_DEPTH)
octree.build_octree(ocnn.octree.Points(points))
dual = ognn.OctreeD(octree)
types = DEPTH - FULL_DEPTH + 1

block = ognn.nn.GraphResBlock2(FINE, FINE, n_node_type=types, bottleneck=FINE // BETWEEN)
down = ognn.nn.GraphDownsample(FINE, COARSE)
up = ognn.nn.GraphUpsample(COARSE, FINE)
head = ognn.nn.Prediction(FINE, HIDDEN, 2)
for module in (block, down, up, head):
    module.train()
    for name, parameter in module.named_parameters():
        if "norm.norm" in name:  # not 1 and 0
            parameter.data += 0.3 * torch.randn_like(parameter)

x = torch.randn(dual.graphs[DEPTH].nnum, FINE, requires_grad=True)
blocked = block(x, dual, DEPTH)
downed = down(blocked, dual, DEPTH)
upped = up(downed, dual, DEPTH - 1)
headed = head(upped, dual, DEPTH)
gradient = torch.randn_like(headed)
headed.backward(gradient)


def affine(norm):
    return torch.stack([norm.norm.weight, norm.norm.bias])


def matrix(linear):
    return linear.linear.weight.t()


tensors = {
    "points": points, "input": x, "blocked": blocked, "downed": downed, "upped": upped, "headed": headed,
    "output_gradient": gradient, "input_gradient": x.grad,
    "block.first": block.conva.conv.weights, "block.first_norm": affine(block.conva.norm),
    "block.second": block.convb.conv.weights, "block.second_norm": affine(block.convb.norm),
    "block.first.gradient": block.conva.conv.weights.grad,
    "down.weights": down.downsample.weights.flatten(1).t(), "down.gradient": down.downsample.weights.grad.flatten(1).t(),
    "down.linear": matrix(down.conv1x1.conv), "down.norm": affine(down.conv1x1.norm),
    "up.weights": up.upsample.weights.flatten(1), "up.gradient": up.upsample.weights.grad.flatten(1),
    "up.linear": matrix(up.conv1x1.conv), "up.norm": affine(up.conv1x1.norm),
    "head.hidden": matrix(head.conv1.conv), "head.norm": affine(head.conv1.norm),
    "head.output": matrix(head.conv2), "head.bias": head.conv2.linear.bias[None],
}
save_file({name: tensor.detach().contiguous() for name, tensor in tensors.items()}, "graph.safetensors")
