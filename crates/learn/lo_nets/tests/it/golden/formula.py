"""Weights and images by a formula that the tests repeat."""

import numpy
import torch


def fnv1a(text):
    value = 0xCBF29CE484222325
    for byte in text.encode():
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value


def noise(name, count):
    """Returns pseudo-random values in [-1, 1), as the test does."""
    h = (numpy.arange(count, dtype=numpy.uint64) + fnv1a(name) % 2**32) * 2654435761 % 2**32
    h ^= h >> 15
    h = h * 2246822519 % 2**32
    h ^= h >> 13
    return torch.from_numpy((h / 2.0**31 - 1).astype(numpy.float32))


def values(name, shape):
    x = noise(name, int(numpy.prod(shape))).reshape(shape)
    if len(shape) == 4:
        return x * (6 / (shape[1] * shape[2] * shape[3])) ** 0.5
    if name.endswith("weight") or name.endswith("running_var"):
        return 1 + 0.4 * x
    return 0.2 * x
