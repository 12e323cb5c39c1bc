"""Exceptions and warnings. The native module raises those of the library by their names here."""


class LightOctreeError(Exception):
    """Base class of the exceptions of this package."""


class DatasetError(LightOctreeError, ValueError):
    """A data set cannot be read, or a room cannot be generated."""


class EstimateError(LightOctreeError, ValueError):
    """The inputs of an estimate cannot be used."""


class ImageError(LightOctreeError, ValueError):
    """An image cannot be read as what it should be, or written."""


class InsertError(LightOctreeError, ValueError):
    """Objects cannot be inserted: a mesh, a material or a place is invalid."""


class LightsError(LightOctreeError, ValueError):
    """A light does not exist, or cannot be applied."""


class SceneError(LightOctreeError, ValueError):
    """A scene file is damaged, or none."""


class LightOctreeWarning(UserWarning):
    """A problem or an assumption that the library reports."""
