"""Measures the cases of depth.rs with PyTorch: the fastest of several repetitions in seconds, on one thread.

    MALLOC_MMAP_THRESHOLD_=4294967296 MALLOC_TRIM_THRESHOLD_=4294967296 OMP_WAIT_POLICY=PASSIVE python3 depth_torch.py [depthwise|networks]

The two malloc variables keep glibc from returning memory between repetitions. Needs torch, torchvision and efficientnet_lite_pytorch.
ATEN_CPU_CAPABILITY=avx2 ONEDNN_MAX_CPU_ISA=AVX2 limit PyTorch to AVX2.
"""

import sys
import time

import torch
import torch.nn.functional as F
import torchvision
from efficientnet_lite_pytorch import EfficientNet

# Channels, kernel side, stride, height and width.
DEPTHWISE = [
    (32, 3, 1, 128, 192),
    (96, 3, 2, 128, 192),
    (144, 3, 1, 64, 96),
    (144, 5, 2, 64, 96),
    (240, 5, 1, 32, 48),
    (240, 3, 2, 32, 48),
    (480, 3, 1, 16, 24),
    (480, 5, 1, 16, 24),
    (672, 5, 2, 16, 24),
    (1152, 5, 1, 8, 12),
]


def best(work, repetitions):
    work()
    seconds = []
    for _ in range(repetitions):
        begun = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begun)
    return min(seconds)


def depthwise(pictures, case):
    channels, side, stride, height, width = case
    x, weights = torch.randn(pictures, channels, height, width), torch.randn(channels, 1, side, side)

    def forward():
        with torch.no_grad():
            return F.conv2d(x, weights, None, stride, side // 2, 1, channels)

    gradient = torch.randn_like(forward())

    def backward(wanted):
        torch.ops.aten.convolution_backward(
            gradient, x, weights, None, [stride] * 2, [side // 2] * 2, [1, 1], False, [0, 0], channels, [*wanted, False]
        )

    yield "depthwise_by_input", best(lambda: backward([True, False]), 20)
    yield "depthwise_by_weights", best(lambda: backward([False, True]), 20)
    yield "depthwise_fwd", best(forward, 20)


def densenet():
    net = torchvision.models.densenet121(weights=None).features.eval()
    photo = torch.rand(1, 3, 320, 480)
    with torch.no_grad():
        yield "densenet121_480x320_fwd", best(lambda: net(photo), 10)


def efficientnet(name):
    # The package lays out padding for one fixed size.
    net = EfficientNet.from_name(f"efficientnet-{name}", image_size=None)
    for module in net.modules():
        if hasattr(module, "static_padding"):
            padding = module.kernel_size[0] - module.stride[0]
            module.static_padding = torch.nn.ZeroPad2d((padding // 2, padding - padding // 2) * 2)

    def features(x):
        x = net._swish(net._bn0(net._conv_stem(x)))
        for block in net._blocks:
            x = block(x)
        return x

    parameters = [p for n, p in net.named_parameters() if n.startswith(("_conv_stem", "_bn0", "_blocks"))]
    adam = torch.optim.Adam(parameters, 1e-4)
    photo, photos = torch.rand(1, 3, 256, 384), torch.rand(8, 3, 256, 384)

    def train():
        adam.zero_grad()
        features(photos).square().mean().backward()
        adam.step()

    net.eval()
    with torch.no_grad():
        yield "efficientnet_384x256_fwd", best(lambda: features(photo), 20)
    net.train()
    yield "efficientnet_384x256_train", best(train, 5)


torch.set_num_threads(1)
wanted = sys.argv[1] if len(sys.argv) > 1 else ""
if wanted in ("", "networks"):
    for what, seconds in densenet():
        print(f"{what} {seconds:.5f}", flush=True)
    for name in ("lite0", "lite2"):
        for what, seconds in efficientnet(name):
            print(f"{what} {name} {seconds:.5f}", flush=True)
if wanted in ("", "depthwise"):
    for pictures in (1, 8):
        for case in DEPTHWISE:
            for what, seconds in depthwise(pictures, case):
                print(f"{what} {pictures} {list(case)} {seconds:.6f}", flush=True)
