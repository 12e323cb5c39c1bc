"""Indoor lighting from one photo.

    import lightoctree

    scene = lightoctree.estimate("photo.jpg")
    panorama = scene.environment(at=(0, -0.5, -2))
    scene.insert({"mesh": "builtin:tea-set", "pixel": (1100, 1150)}).save("composite.png")
"""

from lightoctree import data, render
from lightoctree._errors import (
    DatasetError,
    EstimateError,
    ImageError,
    InsertError,
    LightOctreeError,
    LightOctreeWarning,
    LightsError,
    SceneError,
)
from lightoctree._lightoctree import Composite, Octree, OctreeLevel, Panorama, Scene, Sequence, __version__, estimate
from lightoctree._types import Event, Light, LightChange, MainLight

__all__ = [
    "Composite",
    "DatasetError",
    "EstimateError",
    "Event",
    "ImageError",
    "InsertError",
    "Light",
    "LightChange",
    "LightOctreeError",
    "LightOctreeWarning",
    "LightsError",
    "MainLight",
    "Octree",
    "OctreeLevel",
    "Panorama",
    "Scene",
    "SceneError",
    "Sequence",
    "__version__",
    "data",
    "estimate",
    "render",
]
