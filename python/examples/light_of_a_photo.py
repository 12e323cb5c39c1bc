"""The light of a room, from one photo: panoramas, the main light, spherical harmonics.

Cells are marked by `# %%`, which Jupyter, VS Code and Spyder run as a notebook.
"""

# %% From the photo to the scene
import numpy as np
from PIL import Image

import lightoctree

scene = lightoctree.estimate("photo.jpg")
scene.save("room.scene")
scene

# %% The environment map 15 cm above the floor before the camera
width, height = scene.photo.shape[1], scene.photo.shape[0]
position, normal = scene.surface_at_pixel((width / 2, 0.85 * height))
at = np.add(position, np.multiply(0.15, normal))
panorama = scene.environment(at, size=(512, 256), level=True)
np.save("panorama.npy", panorama)

# %% As a picture: 1 is the photo's white
preview = Image.fromarray(np.uint8(255 * np.clip(panorama, 0, 1) ** (1 / 2.2)))
preview.save("panorama.png")
preview

# %% The light that contributes the most power there
main_light = scene.main_light(at, level=True)
if main_light is not None:
    print("towards", np.round(main_light.direction, 2), "with", f"{main_light.share:.0%}", "of the light")

# %% Irradiance from spherical harmonics (Ramamoorthi and Hanrahan 2001), upwards and downwards
harmonics = scene.sh9(at, level=True)
C1, C2, C3, C4, C5 = 0.429043, 0.511664, 0.743125, 0.886227, 0.247708


def irradiance(x, y, z):
    terms = [C4, 2 * C2 * y, 2 * C2 * z, 2 * C2 * x, 2 * C1 * x * y, 2 * C1 * y * z, C3 * z * z - C5, 2 * C1 * x * z]
    return np.array([*terms, C1 * (x * x - y * y)]) @ harmonics


print("from above", irradiance(0, 1, 0).round(2), "from below", irradiance(0, -1, 0).round(2))

# %% Lights of the room
for light in scene.lights:
    print(light.id, light.kind, light.origin, np.round(light.radiance, 1))
