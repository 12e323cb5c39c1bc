"""What marks Blender's data as parts of rooms, and how the parts are found."""

import bpy

# Custom property of an object of a room: what it is for, by its name in the exported file.
ROLE = "room_light_role"
# Custom property of a room's collection: the bytes of the .scene file.
SCENE = "room_light_scene"
# Custom property of other data that are made for rooms: what they are.
MADE = "room_light_made"
# The value of `MADE` for data of one room.
ROOM = "room"
# What a room's collection refers to, and may share with a copy of itself.
SHARED = ("photo", "world", "compositing", "shading", "empty")


class MissingPart(Exception):
    """The user deleted a part that is not made again."""

    def __init__(self, collection, part):
        super().__init__(f"The {part} of the room {collection.name!r} was deleted. Make the room again")


def part(collection, role):
    """Returns a room's object of a role."""
    found = (thing for thing in collection.all_objects if thing.get(ROLE) == role)
    thing = next(found, None)
    if thing is None:
        raise MissingPart(collection, f"object {role!r}")
    return thing


def photo(collection):
    """Returns a room's photo."""
    if collection.room_light.photo is None:
        raise MissingPart(collection, "photo")
    return collection.room_light.photo


def all_rooms():
    """Returns the collections of the rooms of all scenes."""
    return [collection for collection in bpy.data.collections if collection.room_light.is_room]


def rooms(scene):
    """Returns the collections of the scene's rooms."""
    if is_empty_room(scene):
        return []
    return [collection for collection in scene.collection.children_recursive if collection.room_light.is_room]


def is_empty_room(scene):
    """Returns whether the scene is the room without objects that `empty` makes for EEVEE."""
    return scene.get(MADE) == ROOM


def is_shared(collection, name):
    """Returns whether another room refers to the same data: one of both is a copy."""
    data = getattr(collection.room_light, name)
    return any(getattr(other.room_light, name) == data for other in all_rooms() if other != collection)
