use serde::Serialize;

use crate::TrainingPhase;

/// A problem or an assumption that the user should know about. Structured values; the front end formats them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Warning {
    /// Depth is predicted from the photo alone: distances, sizes and the up direction are uncertain.
    PredictedDepth,
    /// A depth model returned relative depth, which was fitted to the metric depth of the built-in depth network.
    FittedDepth {
        /// `a` of `1 / z = a · d + b`; 1 if the model returns the logarithm of depth.
        scale: f64,
        /// `b`.
        offset: f64,
        /// Share of pixels whose depth agrees with the built-in network's within a ratio of 1.25.
        agree: f64,
        /// Median ratio of the two depths, minus 1.
        median_error: f64,
    },
    /// Points outside the octree's cube were discarded.
    OutsideCube {
        /// Number of discarded points.
        outside: usize,
        /// Number of all points.
        points: usize,
    },
    /// Depths of two photos disagree where their poses make them overlap.
    PosesDisagree {
        /// Indices of the photos.
        photos: [usize; 2],
        /// Median relative difference of the depths.
        disagreement: f32,
    },
    /// Photos overlap neither the first photo nor any photo compared with it: their relative exposures were assumed.
    AssumedExposures {
        /// Indices of the photos.
        photos: Vec<usize>,
    },
    /// An inserted object is completely hidden by real surfaces or other objects.
    ObjectHidden {
        /// Index among the inserted objects, from 0.
        object: usize,
    },
    /// An inserted object is outside the photo.
    ObjectOutsidePicture {
        /// Index among the inserted objects, from 0.
        object: usize,
    },
    /// An inserted object is outside the lighting octree: its light is unreliable.
    ObjectOutsideOctree {
        /// Index among the inserted objects, from 0.
        object: usize,
    },
    /// An inserted object overhangs the surface it stands on: most of its base is unsupported.
    ObjectOverhangs {
        /// Index among the inserted objects, from 0.
        object: usize,
        /// Supported share, from 0 to 1, of the part of the base that can be judged.
        supported: f32,
    },
    /// Two inserted objects intersect.
    ObjectsIntersect {
        /// Indices among the inserted objects, from 0.
        objects: [usize; 2],
    },
    /// Pixels without a depth reading were filled from the room's planes or from their neighbours.
    FilledDepth {
        /// Number of filled pixels.
        filled: usize,
        /// Number of all pixels.
        pixels: usize,
    },
    /// Clipped highlights were reconstructed brighter than white.
    Highlights {
        /// Share of the photo's pixels that are clipped, from 0 to 1.
        clipped_share: f32,
        /// Number of connected regions that were made brighter.
        regions: usize,
        /// Greatest reconstructed radiance; the photo's white is 1.
        peak_radiance: f32,
    },
    /// Visible emitters do not explain the photo's shading: a lamp was assumed in the unobserved part of the ceiling.
    AssumedLamp {
        /// Radiance at its centre; the photo's white is 1.
        radiance: f32,
    },
    /// The brightness of inferred lamps, windows and surfaces was fitted to the photo's shading.
    FittedLamps {
        /// Factor on inferred lamps and windows; `None` if their share of the light is too small to fit.
        lamps: Option<f32>,
        /// Their fitted share of the light on observed surfaces.
        lamps_share: f32,
        /// Factor on clipped lamps and windows beyond the usual highlight reconstruction; `None` as for `lamps`.
        clipped_lamps: Option<f32>,
        /// Their fitted share of the light on observed surfaces.
        clipped_share: f32,
        /// Factor on inferred surfaces.
        surfaces: f32,
    },
    /// Positions of unobserved planes of the room were assumed.
    AssumedPlanes {
        /// Whether the floor's was.
        floor: bool,
        /// Whether the ceiling's was.
        ceiling: bool,
        /// For how many of the four walls.
        walls: usize,
    },
    /// The room's panorama is not HDR: radiance of its clipped pixels is a lower bound.
    ClippedPanorama {
        /// Share of clipped pixels, from 0 to 1.
        clipped_share: f32,
    },
    /// Negative, NaN and infinite values of the room's panorama were replaced by 0.
    PanoramaValues {
        /// Number of pixels with such values.
        cleaned: usize,
        /// Number of all pixels.
        pixels: usize,
    },
    /// The panorama matches the photo poorly: it may be of another room or position, or have another orientation.
    PanoramaMatch {
        /// Confidence of the match, from 0 to 1.
        confidence: f32,
        /// Confidence below which this warning is given.
        least: f32,
        /// Yaw with which the panorama was used, in degrees.
        yaw_deg: f32,
    },
    /// The panorama's position sees too little of the observed region for a comparison with the photo.
    PanoramaNotCompared,
    /// The light network predicted no occupied node at a depth; the most probable one was used.
    NothingOccupied {
        /// Depth of the nodes.
        depth: u32,
    },
    /// The light network predicted more nodes than fit its budget; the most probable ones were split.
    NodeBudget {
        /// Depth of the nodes.
        depth: u32,
        /// Number of nodes predicted to be split.
        predicted: usize,
        /// Number of nodes split.
        kept: usize,
    },
    /// An unusable sample of a dataset was skipped.
    SamplePassedOver {
        /// Name of the sample, or its index in the dataset.
        sample: String,
        /// Error of reading it.
        error: String,
    },
    /// The encoder's initial weights are not the published file: they were converted or trained differently.
    UnpublishedEncoder {
        /// File name.
        file: String,
        /// SHA-256 of the file, in hexadecimal.
        sha256: String,
    },
    /// The dataset differs from the one that the run was started with: the next epoch begins.
    DatasetChanged {
        /// Epoch that begins.
        epoch: u64,
    },
    /// Training met NaN or infinite values and went back to its last checkpoint, to continue with other data.
    SetBack {
        /// Training phase.
        phase: TrainingPhase,
        /// Step of the phase at which that happened.
        step: u64,
        /// Name of the value that is NaN or infinite.
        fault: String,
        /// Step of the checkpoint.
        back_to_step: u64,
    },
}
