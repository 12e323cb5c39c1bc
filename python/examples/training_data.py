"""Generated rooms as training data: a small model that predicts the mean light of a room from its photo."""

# %% Rooms with known light; coarse ones, which take a moment each
import numpy as np

import lightoctree

coarse = {"shots": 2, "panoramas": 1, "panorama_height": 16, "octree_depth": 4}
coarse["light"] = {"spacing_m": 1.0, "gather_rays": 8, "light_rays": 8, "pixel_rays": 1}
rooms = lightoctree.data.rooms(6, seed=1, config=coarse)
sample = rooms[0]
print(sample["id"], sample["photo"].shape, f"{np.median(sample['depth_m']):.1f} m", len(sample["views"]), "panorama")


# %% Input and target of each photo. The data set is a sequence that can be pickled, so that
# `torch.utils.data.DataLoader(rooms, num_workers=2, multiprocessing_context="spawn")` loads it in parallel.
def features(photo):
    linear = (photo / 255.0) ** 2.2
    return np.concatenate([linear.mean((0, 1)), linear.std((0, 1)), [1.0]])


def mean_light(views):
    radiance = views[0]["radiance"]
    weight = np.sin((np.arange(len(radiance)) + 0.5) / len(radiance) * np.pi)
    return np.log((radiance.mean(1) * weight[:, None]).sum(0) / weight.sum() + 1e-3)


usable = [sample for sample in rooms if sample["views"]]
inputs = np.array([features(sample["photo"]) for sample in usable])
targets = np.array([mean_light(sample["views"]) for sample in usable])

# %% Ridge regression, the smallest network of all
weights = np.linalg.solve(inputs.T @ inputs + 0.1 * np.eye(inputs.shape[1]), inputs.T @ targets)
print("error in stops:", np.abs(inputs @ weights - targets).mean() / np.log(2))
