"""Custom properties of Blender's data."""

# What an object of a room is for, by its name in the exported file; only objects of rooms have it.
ROLE = "room_light_role"
# The bytes of the .scene file, of a room's collection.
SCENE = "room_light_scene"
# Marks a compositor that was made for a room.
COMPOSITOR = "room_light"
