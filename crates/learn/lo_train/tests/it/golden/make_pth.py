"""Writes zip.pth and legacy.pth, the two file formats of torch.save. Requires torch. Run in this folder."""

import torch

weights = {
    "conv.weight": torch.arange(6, dtype=torch.float32).reshape(2, 3) / 4,
    "norm.num_batches_tracked": torch.tensor(7),
    "norm.bias": torch.tensor([-1.5, 2.0], dtype=torch.float64),
    # Stored in column-major order.
    "turned.weight": torch.arange(6, dtype=torch.float32).reshape(2, 3).t(),
}
torch.save(weights, "zip.pth")
torch.save(weights, "legacy.pth", _use_new_zipfile_serialization=False)
torch.save({"conv.weight": torch.ones(2, dtype=torch.float16)}, "half.pth")
