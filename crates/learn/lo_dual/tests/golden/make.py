"""Writes ognn.safetensors: a small octree's dual graph and one graph convolution, by `ognn` (DualOctreeGNN's first author).

Needs the environment of the peers' benchmark (ocnn 2.3.3, ognn, torch) and safetensors. Run beside this file.
"""

import ocnn
import ognn
import torch
from safetensors.torch import save_file

torch.manual_seed(5)
DEPTH, FULL_DEPTH, IN, OUT = 5, 2, 6, 5
points = torch.rand(90, 3) * 2 - 1
points[:, 1] = 0.3 * points[:, 0] - 0.05  # a slanted sheet
octree = ocnn.octree.Octree(DEPTH, FULL_DEPTH)
octree.build_octree(ocnn.octree.Points(points))
dual = ognn.OctreeD(octree)
tensors = {"points": points}
for depth in range(FULL_DEPTH, DEPTH + 1):
    graph = dual.graphs[depth]
    edges = torch.stack([graph.edge_idx[0], graph.edge_type, graph.edge_idx[1]], dim=1).tolist()
    tensors[f"edges.{depth}"] = torch.tensor(sorted(edges), dtype=torch.int32)
graph = dual.graphs[DEPTH]
conv = ognn.nn.GraphConv(IN, OUT)
x = torch.randn(graph.nnum, IN, requires_grad=True)
y = conv(x, dual, DEPTH)
gradient = torch.randn_like(y)
y.backward(gradient)
tensors |= {"input": x.detach(), "weights": conv.weights.detach(), "output": y.detach(), "output_gradient": gradient}
tensors |= {"input_gradient": x.grad, "weight_gradient": conv.weights.grad}
save_file(tensors, "ognn.safetensors")
