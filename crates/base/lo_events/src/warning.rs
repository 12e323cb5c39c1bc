use serde::Serialize;

use crate::TrainingPhase;

/// Something that the user should know. Numbers, no words: those are the front end's.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Warning {
    /// Depth is predicted from the photo alone: distances, all sizes and which way is up may be off.
    PredictedDepth,
    /// A depth model gives relative depth: its scale is that of the own depth network's metres.
    FittedDepth {
        /// `a` of `1 / z = a · d + b`; 1 where the model gives the logarithm of depth.
        scale: f64,
        /// `b`.
        offset: f64,
        /// Share of the pixels whose depths agree with the own network's within a ratio of 1.25.
        agree: f64,
        /// Median of the ratios of the two depths, less one.
        median_error: f64,
    },
    /// Points lie outside of the octree's cube and were left out.
    OutsideCube {
        /// How many.
        outside: usize,
        /// Of how many.
        points: usize,
    },
    /// By their poses two photos show the same places, but their depths do not quite agree there.
    PosesDisagree {
        /// Their indices.
        photos: [usize; 2],
        /// Median difference of the depths, share of the depth.
        disagreement: f32,
    },
    /// Photos show nothing that the first or those compared with it show: how brightly they show the same light was guessed.
    AssumedExposures {
        /// Their indices.
        photos: Vec<usize>,
    },
    /// An inserted object does not show: real surfaces, or other objects, stand before all of it.
    ObjectHidden {
        /// Which of those that are inserted together, from 0.
        object: usize,
    },
    /// An inserted object does not show: it lies outside of the picture.
    ObjectOutsidePicture {
        /// Which of those that are inserted together, from 0.
        object: usize,
    },
    /// An inserted object lies outside of the lighting octree: its light is a guess.
    ObjectOutsideOctree {
        /// Which of those that are inserted together, from 0.
        object: usize,
    },
    /// An inserted object stands on a surface that ends below it: most of its base hangs in the air.
    ObjectOverhangs {
        /// Which of those that are inserted together, from 0.
        object: usize,
        /// Share of the base that is carried, from 0 to 1, of what can be judged.
        supported: f32,
    },
    /// Two inserted objects reach into one another.
    ObjectsIntersect {
        /// Which of those that are inserted together, from 0.
        objects: [usize; 2],
    },
    /// Pixels have no depth reading; theirs was taken from the room's planes or from around them.
    FilledDepth {
        /// How many.
        filled: usize,
        /// Of how many.
        pixels: usize,
    },
    /// What the sensor clipped was made brighter than white.
    Highlights {
        /// Share of the photo's pixels that are clipped, from 0 to 1.
        clipped_share: f32,
        /// Connected regions that were made brighter.
        regions: usize,
        /// Greatest radiance given to any of them; the photo's white is 1.
        peak_radiance: f32,
    },
    /// What is seen does not explain its light: a lamp in the ceiling was assumed, where it is not seen.
    AssumedLamp {
        /// Radiance in its middle; the photo's white is 1.
        radiance: f32,
    },
    /// What was guessed of lamps, windows and surfaces is as bright as the photo's shading asks for.
    FittedLamps {
        /// Factor on guessed lamps and windows, where they give a share of the light that counts.
        lamps: Option<f32>,
        /// What they give now, as a share of the light on what is seen.
        lamps_share: f32,
        /// Factor on what the photo shows of lamps and windows but clipped, beyond what such regions usually have, likewise.
        clipped_lamps: Option<f32>,
        /// What these give now, likewise.
        clipped_share: f32,
        /// Factor on guessed surfaces.
        surfaces: f32,
    },
    /// Planes of the room are not seen, so their place is assumed.
    AssumedPlanes {
        /// Whether the floor is one of them.
        floor: bool,
        /// Whether the ceiling is one of them.
        ceiling: bool,
        /// How many of the four walls are.
        walls: usize,
    },
    /// The panorama of the room is no HDR image: where it is clipped its light is a lower bound.
    ClippedPanorama {
        /// Share of its pixels that are clipped, from 0 to 1.
        clipped_share: f32,
    },
    /// Values of the panorama of the room were negative or no numbers, and are taken as 0.
    PanoramaValues {
        /// Pixels with such values.
        cleaned: usize,
        /// Of how many.
        pixels: usize,
    },
    /// The panorama hardly shows what the photo shows: it may be of another room, of another place in it, or turned otherwise.
    PanoramaMatch {
        /// How well it does, from 0 to 1.
        confidence: f32,
        /// The confidence below which this is said.
        least: f32,
        /// The yaw it was laid with, degrees.
        yaw_deg: f32,
    },
    /// The panorama's place sees next to nothing of what the photo shows, so nothing can be compared.
    PanoramaNotCompared,
    /// The light network took no node of a depth to be occupied; the likeliest one was.
    NothingOccupied {
        /// Depth of the nodes.
        depth: u32,
    },
    /// The light network would split more nodes than fit its budget: only the likeliest were.
    NodeBudget {
        /// Depth of the nodes.
        depth: u32,
        /// How many it would split.
        predicted: usize,
        /// How many were.
        kept: usize,
    },
    /// A sample of a dataset cannot be used and was passed over.
    SamplePassedOver {
        /// Its name, or its place in the dataset.
        sample: String,
        /// What is wrong with it.
        error: String,
    },
    /// The weights that an encoder begins with are not the published ones: a converted file, or others.
    UnpublishedEncoder {
        /// The file's name.
        file: String,
        /// Its SHA-256, in hexadecimal.
        sha256: String,
    },
    /// The dataset is not the one that a run was begun with: its next epoch begins.
    DatasetChanged {
        /// The epoch that begins.
        epoch: u64,
    },
    /// Training met numbers that are none and went back to its last checkpoint, to go on with other data.
    SetBack {
        /// The phase.
        phase: TrainingPhase,
        /// Its step at which that happened.
        step: u64,
        /// What is no number.
        fault: String,
        /// The step of the checkpoint.
        back_to_step: u64,
    },
}
