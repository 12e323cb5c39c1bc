"""Writes densenet.safetensors: features and gradients of torchvision's DenseNet-121 with weights from a formula.

Needs torch, torchvision and safetensors. Run beside this file. The test regenerates the weights (30 MB).
"""

import json

import torch
import torchvision
from formula import noise, values
from safetensors.torch import save_file

net = torchvision.models.densenet121(weights=None)
state = {k: v for k, v in net.state_dict().items() if not k.startswith("classifier") and not k.endswith("num_batches_tracked")}
net.load_state_dict({k: values(k, tuple(v.shape)) for k, v in state.items()}, strict=False)
features = net.features


def run(x):
    outputs = []
    for name, module in features.named_children():
        x = module(x)
        if name in ("relu0", "denseblock1", "denseblock2", "denseblock3", "norm5"):
            outputs.append(x.clone())  # some modules work in place
    return outputs


x = noise("photo", 3 * 64 * 96).reshape(1, 3, 64, 96)
tensors = {}
features.eval()
with torch.no_grad():
    for i, y in enumerate(run(x)):
        tensors[f"eval.{i}"] = y.flatten()[::31]
# In f64: with batch statistics of six positions, f32 rounding switches ReLUs and changes the gradient by a percent.
features.train().double()
y = run(x.double())[4]
(y * noise("gradient", y.numel()).reshape(y.shape).double()).sum().backward()
tensors["train.4"] = y.detach().flatten()[::7]
for name in ("conv0.weight", "denseblock2.denselayer3.norm1.weight", "denseblock4.denselayer16.conv2.weight", "transition3.conv.weight"):
    gradient = dict(features.named_parameters())[name].grad.flatten()
    tensors[f"gradient.{name}"] = gradient[:: max(1, gradient.numel() // 2000)]
tensors["running_mean"] = features.denseblock3.denselayer5.norm2.running_mean
tensors["running_var"] = features.denseblock3.denselayer5.norm2.running_var
shapes = json.dumps({k: list(v.shape) for k, v in state.items()})
save_file({k: v.float().contiguous().clone() for k, v in tensors.items()}, "densenet.safetensors", metadata={"shapes": shapes})
