"""The renderer as a differentiable function: an octree whose radiance explains a panorama."""

# %% An octree of a room of our own: the points of a box, grey
import numpy as np

from lightoctree.render import Octree, panorama_rays, trace, trace_backward

rng = np.random.default_rng(1)
points = rng.uniform(-1, 1, (60_000, 3)) * (2.0, 1.3, 2.5)
wall = rng.integers(0, 3, len(points))
rows = np.arange(len(points))
points[rows, wall] = np.sign(points[rows, wall]) * np.array((2.0, 1.3, 2.5))[wall]
octree = Octree.from_points(points, np.full_like(points, 0.2), depth=5)

# %% What it should look like: a bright ceiling
directions, tan_half_angle = panorama_rays(32)
target = np.where(directions[..., 1:2] > 0.5, (1.0, 0.9, 0.7), (0.3, 0.25, 0.2))

# %% Gradient descent on the radiance of all rows
rgba = octree.rgba
for step in range(60):
    samples = trace(octree, (0, 0, 0), directions, tan_half_angle=tan_half_angle, rgba=rgba)
    error = samples[..., :3] - target
    d_samples = np.zeros_like(samples)
    d_samples[..., :3] = error
    gradient = trace_backward(octree, (0, 0, 0), directions, d_samples, tan_half_angle=tan_half_angle, rgba=rgba)
    rgba[:, :3] -= 0.02 * gradient[:, :3]
    if step % 20 == 0:
        print(step, f"{(error**2).mean():.5f}")

# %% The light of a place that the panorama did not show
seen = trace(octree, (1.0, -0.5, 1.0), directions, tan_half_angle=tan_half_angle, rgba=rgba)
print("from above", seen[2, :, :3].mean(0).round(2), "from below", seen[-3, :, :3].mean(0).round(2))

# %% The same for PyTorch
try:
    import torch
except ImportError:
    torch = None

if torch is not None:

    class Trace(torch.autograd.Function):
        """Samples [..., 5] of cones through an octree with the features `rgba` [rows, 4]."""

        @staticmethod
        def forward(ctx, rgba, octree, origins, directions, tan_half_angle):
            ctx.cones = (octree, origins, directions), tan_half_angle
            ctx.save_for_backward(rgba)
            values = rgba.detach().numpy()
            return torch.from_numpy(trace(octree, origins, directions, tan_half_angle=tan_half_angle, rgba=values))

        @staticmethod
        def backward(ctx, d_samples):
            cones, tan_half_angle = ctx.cones
            (rgba,) = ctx.saved_tensors
            d_samples = d_samples.contiguous().numpy()
            values = rgba.detach().numpy()
            gradient = trace_backward(*cones, d_samples, tan_half_angle=tan_half_angle, rgba=values)
            return torch.from_numpy(gradient), None, None, None, None

    features = torch.from_numpy(octree.rgba).requires_grad_()
    optimizer = torch.optim.Adam([features], lr=0.02)
    for step in range(60):
        samples = Trace.apply(features, octree, (0, 0, 0), directions, tan_half_angle)
        loss = ((samples[..., :3] - torch.from_numpy(target)) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    print("PyTorch", f"{loss.item():.5f}")
