"""Objects in a photo: light, shadow and reflections, layers, movement."""

# %% A scene
import numpy as np

import lightoctree

scene = lightoctree.estimate("photo.jpg")
width, height = scene.photo.shape[1], scene.photo.shape[0]
middle = (width / 2, 0.85 * height)

# %% Two objects on the surface at a pixel
composite = scene.insert(
    [
        {"mesh": "builtin:suzanne", "pixel": middle, "height_m": 0.2, "material": "gold"},
        {"mesh": "builtin:sphere", "pixel": (0.3 * width, 0.85 * height), "height_m": 0.12, "material": "chrome"},
    ],
    passes=True,
)
composite.save("composite.png")
composite.save_layers("composite.exr")
composite

# %% The same from its layers, in linear light: composite.image adds the photo's grain and sharpness
layers = composite.layers
srgb = scene.photo / 255
photo = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
below = photo * layers["shadow_ratio"] + layers.get("reflection", 0)
linear = below * (1 - layers["alpha"][..., None]) + layers["object"]
print("darkest shadow", layers["shadow_ratio"].min().round(2))

# %% A dimmer room
for light in scene.lights:
    scene.set_light(light.id, scale=0.5)
scene.insert({"mesh": "builtin:suzanne", "pixel": middle, "height_m": 0.2}).save("dimmed.png")
scene.reset_lights()

# %% A ball that rolls
path = {"keyframes": [{"time_s": 0, "pixel": [0.3 * width, 0.85 * height]}, {"time_s": 1, "pixel": list(middle)}]}
ball = {"mesh": "builtin:sphere", "height_m": 0.12, "path": path, "material": "chrome"}
for index, image in enumerate(scene.sequence(ball, frames=4, quality="draft")):
    image.save(f"ball_{index:04}.png")
