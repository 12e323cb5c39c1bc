// Generated from the protocol by the command
// UPDATE_SNAPSHOTS=1 cargo test -p lo_viewer --features typescript --test protocol_types

/**
 * Alignment of an object's +Y.
 */
export type Align = "gravity" | "surface" | "none";

/**
 * A pinhole camera at the world's origin, looking along −Z.
 *
 * Lengths are in pixels of an image of `width` × `height`. Pixel centres are at +0.5; `u` points right and `v` down.
 */
export type Camera = {
/**
 * Horizontal focal length in pixels.
 */
fx: number,
/**
 * Vertical focal length in pixels.
 */
fy: number,
/**
 * Horizontal coordinate of the principal point in pixels.
 */
cx: number,
/**
 * Vertical coordinate of the principal point in pixels.
 */
cy: number,
/**
 * Image width in pixels.
 */
width: number,
/**
 * Image height in pixels.
 */
height: number, };

/**
 * One edit of a session.
 */
export type Command = { "do": "add",
/**
 * Name of the mesh.
 */
mesh: string,
/**
 * Photo position; `None` chooses a free supporting surface.
 */
pixel?: [number, number] | null,
/**
 * Replaces the mesh's own materials.
 */
material?: ObjectMaterial | null, } | { "do": "duplicate",
/**
 * Id of the object.
 */
object: number, } | { "do": "delete",
/**
 * Id of the object.
 */
object: number, } | { "do": "rename",
/**
 * Id of the object.
 */
object: number,
/**
 * The new name.
 */
name: string, } | { "do": "place",
/**
 * Id of the object.
 */
object: number,
/**
 * The new position.
 */
place: ObjectPosition, } | { "do": "drag",
/**
 * Id of the object.
 */
object: number,
/**
 * Photo position, pixels.
 */
to: [number, number], } | { "do": "put-down",
/**
 * Id of the object.
 */
object: number, } | { "do": "size",
/**
 * Id of the object.
 */
object: number,
/**
 * The new size.
 */
size: ObjectSize, } | { "do": "turn",
/**
 * Id of the object.
 */
object: number,
/**
 * The new rotation, degrees.
 */
yaw_deg: number, } | { "do": "align",
/**
 * Id of the object.
 */
object: number,
/**
 * The new alignment.
 */
align: Align, } | { "do": "material",
/**
 * Id of the object.
 */
object: number,
/**
 * The material; `None` restores the mesh's own.
 */
material: ObjectMaterial | null, } | { "do": "show",
/**
 * Id of the object.
 */
object: number,
/**
 * Whether images show it.
 */
is_shown: boolean, } | { "do": "lock",
/**
 * Id of the object.
 */
object: number,
/**
 * Whether it is protected.
 */
is_locked: boolean, } | { "do": "set-key",
/**
 * Id of the object.
 */
object: number,
/**
 * Time of the keyframe, seconds.
 */
time_s: number, } | { "do": "move-key",
/**
 * Id of the object.
 */
object: number,
/**
 * Current time of the keyframe, seconds.
 */
from_s: number,
/**
 * New time of the keyframe, seconds.
 */
to_s: number, } | { "do": "delete-key",
/**
 * Id of the object.
 */
object: number,
/**
 * Time of the keyframe, seconds.
 */
time_s: number, } | { "do": "interpolate",
/**
 * Id of the object.
 */
object: number,
/**
 * The new interpolation.
 */
interpolation: Interpolation, } | { "do": "known-length",
/**
 * The length; `None` restores the scale of the scene file.
 */
known?: KnownLength | null, } | { "do": "frames",
/**
 * Number of frames; `None` follows from the keyframes and `fps`.
 */
frames?: number | null,
/**
 * Frames per second.
 */
fps: number, } | { "do": "floor-gloss",
/**
 * From 0 to 1.
 */
gloss: number, } | { "do": "inferred-light",
/**
 * The light.
 */
light: LightMode, } | { "do": "contrast",
/**
 * Factor on the contrast of similar rooms in stops, 0 to 3.
 */
factor: number, } | { "do": "warmth",
/**
 * Stops by which the light is redder than estimated, −4 to 4.
 */
ev: number, } | { "do": "white",
/**
 * Position of the pixel; `None` clears it.
 */
pixel?: [number, number] | null, } | { "do": "set-light",
/**
 * Id of the light.
 */
light: string,
/**
 * The edit.
 */
change: LightChange, } | { "do": "add-light",
/**
 * The new light.
 */
new: NewLight, } | { "do": "replace-light",
/**
 * Id of the light.
 */
light: string,
/**
 * The new light.
 */
new: NewLight, } | { "do": "remove-light",
/**
 * Id of the light.
 */
light: string, } | { "do": "drag-light",
/**
 * Id of the light.
 */
light: string,
/**
 * Photo position, pixels.
 */
to: [number, number], } | { "do": "aim-sun",
/**
 * Id of the light.
 */
light: string,
/**
 * Id of the object.
 */
object: number,
/**
 * Photo position of the shadow, pixels.
 */
to: [number, number], } | { "do": "turn-sun",
/**
 * Id of the light.
 */
light: string,
/**
 * Degrees to the right of the camera's axis, about the vertical.
 */
azimuth_deg: number,
/**
 * Degrees above the horizon.
 */
elevation_deg: number, } | { "do": "reset-lights" } | { "do": "together",
/**
 * The commands, at most as many as objects; none of them moves a keyframe, scales the room or consists of
 * others.
 */
commands: Array<Command>, };

/**
 * A message from the page.
 */
export type FromPage = { "type": "command",
/**
 * The command.
 */
command: Command, } | { "type": "preview",
/**
 * The command.
 */
command: Command,
/**
 * Number of the message; images refer to it.
 */
sequence: number, } | { "type": "commit" } | { "type": "cancel" } | { "type": "undo" } | { "type": "redo" } | { "type": "seek",
/**
 * The time, seconds.
 */
time_s: number,
/**
 * Number of the message; images refer to it.
 */
sequence: number, } | { "type": "stop-film" } | { "type": "probe",
/**
 * Photo position of the surface below the point.
 */
pixel: [number, number],
/**
 * Distance from the surface, metres.
 */
lift_m: number,
/**
 * Exposure of the images, stops.
 */
exposure_ev: number, } | { "type": "measure",
/**
 * Photo positions of the ends, pixels.
 */
ends: [[number, number], [number, number]], } | { "type": "overlay",
/**
 * The overlay.
 */
what: Overlay, } | { "type": "outside",
/**
 * Number of the request; the image refers to it.
 */
sequence: number,
/**
 * The view.
 */
view: OutsideView, } | { "type": "stop" } | { "type": "saved",
/**
 * Number of the change, from the download's header `x-change`.
 */
change: number,
/**
 * Name of the file.
 */
file: string, };

/**
 * Choice of light for unobserved regions.
 */
export type InferredLightView = {
/**
 * Effect of other choices.
 */
effect: LightEffect,
/**
 * The light.
 */
light: LightMode,
/**
 * Factor on the contrast of plausible light, in stops; 1 is typical of such a room.
 */
contrast: number,
/**
 * Stops by which red exceeds blue more than estimated, or than `white` gives; luminance is kept.
 */
warmth_ev: number,
/**
 * Photo pixel that shows something white: inferred light gets the colour that white has there.
 */
white?: [number, number], };

/**
 * Interpolation between keyframes.
 */
export type Interpolation = "linear" | "catmull-rom";

/**
 * Position and yaw at one time.
 */
export type Keyframe = {
/**
 * Time in seconds.
 */
time_s: number,
/**
 * World position of the object's base in metres; alternative to `pixel`.
 */
position_m?: [number, number, number],
/**
 * Photo position whose surface the object rests on; alternative to `position_m`.
 */
pixel?: [number, number],
/**
 * Rotation about the up axis in degrees; not wrapped, so 0 → 720 is two turns.
 */
yaw_deg: number, };

/**
 * The real length between two points of the photo.
 */
export type KnownLength = {
/**
 * Photo positions of the ends, pixels.
 */
ends: [[number, number], [number, number]],
/**
 * The real length, metres.
 */
length_m: number, };

/**
 * Change of a light; by default none.
 */
export type LightChange = {
/**
 * Whether it is on.
 */
on?: boolean,
/**
 * Gain of its radiance, from 0 to [`MAX_LIGHT_SCALE`].
 */
scale?: number,
/**
 * New colour; luminance is kept.
 */
color?: LightColor,
/**
 * New centre, metres; ignored for suns.
 */
at_m?: [number, number, number], };

/**
 * Colour of a light; its luminance is ignored.
 */
export type LightColor = { "kelvin": number } | { "rgb": [number, number, number] };

/**
 * Effect of the choice of light on a scene.
 */
export type LightEffect = "none" | "fitted" | "expected";

/**
 * Kind of light.
 */
export type LightKind = "lamp" | "window" | "bright-surface" | "area" | "sun";

/**
 * Light that a scene is rendered with.
 */
export type LightMode = "even" | "expected" | "plausible";

/**
 * Source of a light.
 */
export type LightOrigin = "seen" | "panorama" | "guessed" | "added";

/**
 * One light.
 */
export type LightView = {
/**
 * Edits of the light.
 */
changed: LightChange,
/**
 * Direction of a sun: degrees to the right of the camera's axis, and above the horizon.
 */
sun_deg: [number, number] | null,
/**
 * Name of the light.
 */
id: string,
/**
 * Kind of light.
 */
kind: LightKind,
/**
 * Source of the light.
 */
origin: LightOrigin,
/**
 * Centre, in metres in the photo's frame; absent for a sun.
 */
position_m?: [number, number, number],
/**
 * Unit direction of emission; for a sun, the direction towards it. Absent for lights that shine in all directions.
 */
direction?: [number, number, number],
/**
 * Width and height of a rectangle, in metres.
 */
size_m?: [number, number],
/**
 * Radius of a sphere, in metres.
 */
radius_m?: number,
/**
 * Angular radius of a sun, in degrees.
 */
angular_radius_deg?: number,
/**
 * Emitting area in m²; absent for a sun.
 */
area_m2?: number,
/**
 * Mean linear RGB radiance.
 */
radiance: [number, number, number],
/**
 * Luminance of the irradiance on a surface facing a sun; absent for other lights.
 */
irradiance?: number,
/**
 * Correlated colour temperature, where the colour is near that of a black body.
 */
color_temperature_k?: number,
/**
 * Share of the total light emitted by surfaces; absent for added lights.
 */
flux_share?: number,
/**
 * Confidence, from 0 to 1.
 */
certainty?: number,
/**
 * The user's edit of the light.
 */
change?: LightChange, };

/**
 * A light to add, in user-facing units.
 */
export type NewLight = { "sun": {
/**
 * Degrees to the right of the camera's axis, about the vertical.
 */
azimuth_deg: number,
/**
 * Degrees above the horizon.
 */
elevation_deg: number,
/**
 * Luminance of the irradiance on a surface facing the sun.
 */
strength: number,
/**
 * Angular diameter, degrees.
 */
angle_deg: number,
/**
 * Colour temperature, kelvin.
 */
kelvin: number, } } | { "sphere": {
/**
 * Centre, metres.
 */
at_m: [number, number, number],
/**
 * Radius, metres.
 */
radius_m: number,
/**
 * Luminance of the radiance; 1 is the photo's white.
 */
radiance: number,
/**
 * Colour temperature, kelvin.
 */
kelvin: number, } };

/**
 * A material for a whole object: a preset, optionally modified.
 *
 * References no files, because whoever edits it may lack the right to read them.
 */
export type ObjectMaterial = {
/**
 * One of [`Material::preset_names`](lo_mesh::Material::preset_names).
 */
preset?: string,
/**
 * Linear RGB in [0, 1].
 */
base_color?: [number, number, number],
/**
 * 0 dielectric … 1 metal.
 */
metallic?: number,
/**
 * Perceptual roughness in [0, 1].
 */
roughness?: number, };

/**
 * Position of an object, as on the command line of `insert`.
 */
export type ObjectPosition = { "pixel": [number, number] } | { "position": [number, number, number] };

/**
 * Size of an object.
 */
export type ObjectSize = { "scale": number } | { "height": number };

/**
 * One object.
 */
export type ObjectView = {
/**
 * Id.
 */
id: number,
/**
 * Name.
 */
name: string,
/**
 * Name of the mesh.
 */
mesh: string,
/**
 * Position as entered.
 */
place: ObjectPosition,
/**
 * Size as entered.
 */
size: ObjectSize,
/**
 * Rotation, degrees.
 */
yaw_deg: number,
/**
 * Keyframes, if the object is animated.
 */
path: Path | null,
/**
 * Direction that the up axis is aligned with.
 */
align: Align,
/**
 * Material that replaces the mesh's own.
 */
material: ObjectMaterial | null,
/**
 * Whether images leave it out.
 */
is_hidden: boolean,
/**
 * Whether it is protected from being moved by accident.
 */
is_locked: boolean,
/**
 * Middle of the base, metres.
 */
position_m: [number, number, number],
/**
 * Unit vector of the up axis.
 */
up: [number, number, number],
/**
 * Extent along the object's axes, metres.
 */
size_m: [number, number, number],
/**
 * Metres per unit of the mesh.
 */
scale: number,
/**
 * Whether a surface supports it.
 */
rests: boolean,
/**
 * Shadows of its top in the added suns that are on.
 */
shadows: Array<ShadowView>,
/**
 * Unit of the mesh's coordinates, in the plural.
 */
unit: string,
/**
 * Metres per unit of the mesh by that unit.
 */
metres_per_unit: number,
/**
 * Whether the mesh's format defines the unit; otherwise it is inferred.
 */
unit_is_stated: boolean, };

/**
 * A view of the room from any viewpoint.
 *
 * The camera is a pinhole with square pixels at `eye_m`. Its axis passes through `target_m` and the image centre; up
 * is against gravity. In its frame (x = ahead × up, y = up, z = −ahead) [`Camera::project`] applies, with a focal
 * length of `height / (2 tan(fov / 2))` pixels.
 */
export type OutsideView = {
/**
 * Viewpoint, metres in the photo's frame.
 */
eye_m: [number, number, number],
/**
 * Point at the image centre, metres in the photo's frame.
 */
target_m: [number, number, number],
/**
 * Vertical field of view, degrees, 5 to 120.
 */
fov_deg: number,
/**
 * Width, pixels, at most 1920.
 */
width: number,
/**
 * Height, pixels, at most 1440.
 */
height: number,
/**
 * Exposure, stops, −20 to 20.
 */
exposure_ev: number,
/**
 * Overlay to show instead of radiance.
 */
show: Overlay | null,
/**
 * Whether the view is at rest: four rays per pixel instead of one.
 */
still: boolean, };

/**
 * An overlay on the photo.
 */
export type Overlay = "depth" | "normals" | "levels" | "origins";

/**
 * Path of a moving object: keyframes over time, read from JSON.
 *
 * ```json
 * {"interpolation": "catmull-rom",
 *  "keyframes": [{"time_s": 0, "position_m": [0, -1, -3], "yaw_deg": 0},
 *                {"time_s": 1, "pixel": [320, 400], "yaw_deg": 90}]}
 * ```
 */
export type Path = {
/**
 * Interpolation of positions and yaw between keyframes.
 */
interpolation: Interpolation,
/**
 * Keyframes by ascending time; at least one.
 */
keyframes: Array<Keyframe>, };

/**
 * A material preset.
 */
export type Preset = {
/**
 * Name.
 */
name: string,
/**
 * Linear RGB base colour.
 */
base_color: [number, number, number],
/**
 * 0 dielectric … 1 metal.
 */
metallic: number,
/**
 * Perceptual roughness.
 */
roughness: number, };

/**
 * Description of a room.
 */
export type RecentRoom = {
/**
 * Unique name, 16 hexadecimal digits.
 */
id: string,
/**
 * Path of the scene file on the command line.
 */
file: string,
/**
 * Whether that file exists.
 */
has_file: boolean,
/**
 * Whether the room has changes that this file has not.
 */
unsaved: boolean,
/**
 * Number of objects.
 */
objects: number,
/**
 * Time of the last change, seconds since 1970.
 */
changed_s: number, };

/**
 * Progressive rendering steps of one state, in increasing quality.
 */
export type RenderStep = "moving" | "resting" | "final";

/**
 * Approximate extent of a room.
 */
export type RoomExtent = {
/**
 * Centre, metres in the photo's frame.
 */
middle_m: [number, number, number],
/**
 * Distance from the centre to the farthest corner, metres.
 */
radius_m: number,
/**
 * Height of the floor relative to the camera, metres, negative. Without a known floor, the lowest observed height.
 */
floor_m: number, };

/**
 * A sample as listed on the page.
 */
export type SampleView = {
/**
 * Title.
 */
title: string,
/**
 * Name of the photo.
 */
file: string, };

/**
 * An open scene.
 */
export type SceneInfo = {
/**
 * Unique number of the opened scene.
 */
scene: number,
/**
 * Camera, in pixels of the photo.
 */
camera: Camera,
/**
 * Unit vector against gravity, in the camera's frame.
 */
up: [number, number, number],
/**
 * Approximate extent of the room.
 */
extent: RoomExtent,
/**
 * Whether the depth is predicted, not measured.
 */
predicted_depth: boolean,
/**
 * Whether a panorama contributed light.
 */
has_panorama: boolean,
/**
 * Warnings of opening the scene.
 */
notes: Array<string>, };

/**
 * A session as data for a front end.
 */
export type SessionView = {
/**
 * Objects in the photo.
 */
objects: Array<ObjectView>,
/**
 * Choice of light for unobserved regions.
 */
inferred_light: InferredLightView,
/**
 * Found and added lights.
 */
lights: Array<LightView>,
/**
 * Gloss of the surfaces that carry objects, 0 to 1.
 */
floor_gloss: number,
/**
 * Length to which the room of the scene file is scaled.
 */
known_length: KnownLength | null,
/**
 * Factor by which the room is larger than in the scene file.
 */
room_scale: number,
/**
 * Whether there is a step to undo.
 */
can_undo: boolean,
/**
 * Whether there is a step to redo.
 */
can_redo: boolean,
/**
 * Command line that renders the final image; `None` without objects.
 */
command: string | null,
/**
 * Path of the scene file on the command line.
 */
file: string,
/**
 * Whether that file exists; otherwise the scene must be saved before `command` works.
 */
has_file: boolean,
/**
 * Whether the scene must be saved before `command` works, because its light edits differ from the file's.
 */
edited: boolean,
/**
 * Whether objects, lights or keyframes differ from the last opened or saved file.
 */
unsaved: boolean,
/**
 * Names of the available meshes.
 */
meshes: Array<string>,
/**
 * Current time, keyframe range and frames.
 */
timeline: TimelineView, };

/**
 * Shadow of an object's top.
 */
export type ShadowView = {
/**
 * Id of the sun.
 */
light: string,
/**
 * Photo position, pixels; may be outside of the photo.
 */
pixel: [number, number], };

/**
 * Timeline of a session.
 */
export type TimelineView = {
/**
 * Current time, seconds.
 */
time_s: number,
/**
 * Times of the first and last keyframe, seconds; `None` without keyframes.
 */
span_s: [number, number] | null,
/**
 * Number of frames of the sequence.
 */
frames: number,
/**
 * Whether the user chose `frames`.
 */
is_chosen: boolean,
/**
 * Frames per second.
 */
fps: number, };

/**
 * A message from the server.
 */
export type ToPage = { "type": "hello",
/**
 * Version of the program.
 */
version: string,
/**
 * Material presets.
 */
materials: Array<Preset>,
/**
 * Whether this program can estimate photos.
 */
can_estimate: boolean,
/**
 * Whether open rooms are saved automatically.
 */
autosaves: boolean,
/**
 * Photos to try the program with.
 */
samples: Array<SampleView>, } | { "type": "empty",
/**
 * Why the last scene could not be opened.
 */
error: string | null, } | { "type": "opening",
/**
 * Name of the file.
 */
file: string,
/**
 * Current stage.
 */
stage: string,
/**
 * Progress of the stage, 0 to 1, if known.
 */
done: number | null, } | { "type": "opening-ended" } | { "type": "scene" } & SceneInfo | { "type": "state",
/**
 * Number of the change; images refer to it.
 */
change: number,
/**
 * The session.
 */
view: SessionView, } | { "type": "notes",
/**
 * Number of the change.
 */
change: number,
/**
 * Warnings as sentences.
 */
notes: Array<string>, } | { "type": "progress",
/**
 * Number of the change.
 */
change: number,
/**
 * Rendering step.
 */
step: RenderStep,
/**
 * Current stage.
 */
stage: string,
/**
 * Progress of the stage, 0 to 1.
 */
done: number, } | { "type": "photo",
/**
 * Length of the image, bytes.
 */
lengths: [number], } | { "type": "frame",
/**
 * Number of the change that the image shows.
 */
change: number,
/**
 * Number of the last preview that the image shows.
 */
sequence: number,
/**
 * Rendering step.
 */
step: RenderStep,
/**
 * `image/jpeg` or `image/png`.
 */
mime: string,
/**
 * Column and row on [`ToPage::Photo`] of the region's first pixel; `None` for a whole image.
 */
at: [number, number] | null,
/**
 * Length of the image, bytes.
 */
lengths: [number],
/**
 * Rendering time, milliseconds.
 */
took_ms: number, } | { "type": "probe",
/**
 * Photo position of the request.
 */
pixel: [number, number],
/**
 * The point, metres.
 */
at_m: [number, number, number],
/**
 * Lengths of the images, bytes.
 */
lengths: [number, number, number], } | { "type": "no-probe" } | { "type": "measured",
/**
 * Photo positions of the ends, pixels.
 */
ends: [[number, number], [number, number]],
/**
 * The length, metres; `None` if an end has no depth.
 */
length_m: number | null, } | { "type": "overlay",
/**
 * The overlay.
 */
what: Overlay,
/**
 * CSS colours and their meanings.
 */
legend: Array<[string, string]>,
/**
 * Length of the image, bytes.
 */
lengths: [number], } | { "type": "outside",
/**
 * Number of the request.
 */
sequence: number,
/**
 * `image/jpeg` during a movement, `image/png` at rest.
 */
mime: string,
/**
 * Length of the image, bytes.
 */
lengths: [number],
/**
 * Rendering time, milliseconds.
 */
took_ms: number, } | { "type": "film",
/**
 * Finished frames.
 */
done: number,
/**
 * Total number of frames.
 */
frames: number,
/**
 * Estimated remaining time, seconds, if known.
 */
left_s: number | null,
/**
 * Why the download ended early.
 */
ended: string | null, } | { "type": "recent",
/**
 * The rooms.
 */
rooms: Array<RecentRoom>, } | { "type": "refused",
/**
 * The reason.
 */
why: string, };
