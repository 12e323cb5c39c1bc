use std::path::Path;

use lo_events::OnEvent;
use lo_geometry::Vec3;
use lo_nets::Networks;
use lo_nets::checkpoint::CheckpointError;
use lo_octree::check_depths;
use lo_scene::{Completion, Estimate, EstimateOrigin, ExpectedLight, Frame};

use crate::completed_room::{CompletedRoom, by_network, by_shell, observed_only};
use crate::framed::FramedPhoto;
use crate::panorama::apply_prior;
use crate::prepared_input::PreparedInput;
use crate::{DEFAULT_OCTREE_DEPTH, EstimateError, EstimateOptions, Input};

/// Estimates a room's radiance from photos, with or without depth.
///
/// An estimator holds the depth, light and expected-light networks, or none.
#[derive(Debug)]
pub struct Estimator {
    networks: Option<Networks>,
}

impl Estimator {
    /// Loads the trained networks that are embedded in this library (feature `weights`).
    ///
    /// # Errors
    /// Only if the embedded weights are corrupt.
    #[cfg(feature = "weights")]
    pub fn shipped() -> Result<Self, CheckpointError> {
        crate::weights::shipped_networks().map(Self::new)
    }

    /// Loads networks from a `.safetensors` file of weights.
    ///
    /// # Errors
    /// If the file cannot be read or does not hold such networks.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        Networks::read(path).map(Self::new)
    }

    /// Creates an estimator with the given networks.
    pub fn new(networks: Networks) -> Self {
        Self { networks: Some(networks) }
    }

    /// Creates an estimator without networks: rooms are closed by planes, and photos need depth.
    pub const fn without_networks() -> Self {
        Self { networks: None }
    }

    /// Returns the networks, if there are any.
    pub fn networks(&self) -> Option<&Networks> {
        self.networks.as_ref()
    }

    /// Estimates the room's radiance from one or several photos (`docs/method.md`).
    ///
    /// The world frame is the first camera's: metres, +X right, +Y up, −Z along the optical axis. Unclipped observed
    /// radiance is kept as in the photo. Black bars around a photo are left out of the estimate. The result is
    /// bit-identical for the same input, options and weights, on any number of threads.
    ///
    /// `on_event` receives stages, figures and warnings, and may cancel the job after each of them.
    ///
    /// # Errors
    /// - [`EstimateError::NoUsableDepth`], [`EstimateError::NoPhotos`], [`EstimateError::PosesDisagree`] or
    ///   [`EstimateError::Frame`] for input that cannot be used.
    /// - [`EstimateError::Octree`], [`EstimateError::OctreeDepth`], [`EstimateError::Panorama`] or
    ///   [`EstimateError::PanoramaWithoutRoom`] for invalid options. They are checked before any work.
    /// - [`EstimateError::ApplyPanorama`] if the panorama cannot be applied to the room.
    /// - [`EstimateError::NoNetworks`] if input or options need networks and there are none.
    /// - [`EstimateError::NonFiniteDepth`] or [`EstimateError::Light`] if a network fails.
    /// - [`EstimateError::Cancelled`] if `on_event` breaks off.
    pub fn estimate(
        &self,
        input: Input,
        options: &EstimateOptions,
        on_event: OnEvent<'_>,
    ) -> Result<Estimate, EstimateError> {
        let (method, octree_depth) = self.plan(options)?;
        let (input, framed) = FramedPhoto::unframe(input, on_event)?;
        let mut input = PreparedInput::new(input, self.networks(), on_event)?;
        let prior = options.panorama.as_ref();
        let found_up = match method {
            Method::Network(_) | Method::Shell if options.up.is_none() => input.up(self.networks(), on_event)?,
            _ => None,
        };
        let options = &EstimateOptions {
            up: options.up.or(found_up.map(|(up, _)| up)),
            sources: options.sources.clone(),
            panorama: None,
            distorted: options.distorted.clone(),
            ..*options
        };
        let mut completed = match method {
            Method::Network(networks) => by_network(&input, networks, octree_depth, options, on_event)?,
            Method::Shell => by_shell(&input, octree_depth, options, on_event)?,
            Method::None => observed_only(&input, octree_depth, options, on_event)?,
        };
        let panorama =
            prior.map(|prior| apply_prior(&mut completed, prior, &input.observed()[0], on_event)).transpose()?;
        let up = completed.room.as_ref().map(|room| room.up);
        let expected = match (&method, up) {
            (Method::Network(networks), Some(up)) => expected_light(networks, &input.working, up),
            _ => None,
        };
        let CompletedRoom { light, room, confidence } = completed;
        let (other_photos, PreparedInput { frame, predicted_depth, model: depth_model, .. }) =
            (input.other_photos(), input);
        let (completion, sources) = (method.into(), options.sources.clone());
        let origin = EstimateOrigin {
            completion,
            camera_source: options.camera_source,
            up_deviation_deg: found_up.and_then(|(_, deviation_deg)| deviation_deg).map(|deg| deg as f32),
            sources,
            predicted_depth,
            depth_model,
        };
        let frame = match framed {
            Some(framed) => framed.frame(frame),
            None => frame,
        };
        let observed = Estimate::observed_only(light, frame);
        let distorted = options.distorted.clone();
        Ok(Estimate { distorted, room, confidence, expected, panorama, other_photos, origin, ..observed })
    }

    /// Checks the options and returns the completion method and the octree's depth.
    ///
    /// This precedes all work, because the shell's closing points grow with 4^depth.
    fn plan(&self, options: &EstimateOptions) -> Result<(Method<'_>, u32), EstimateError> {
        let mut octree_depth = options.octree_depth.unwrap_or(DEFAULT_OCTREE_DEPTH);
        let default = if self.networks.is_some() { Completion::Network } else { Completion::Shell };
        let method = match options.completion.unwrap_or(default) {
            Completion::Network => {
                let networks = self.networks().ok_or(EstimateError::NoNetworks("completion by a network"))?;
                let own = networks.config.depth;
                if let Some(asked) = options.octree_depth.filter(|&asked| asked < own) {
                    return Err(EstimateError::OctreeDepth { asked, own });
                }
                octree_depth = octree_depth.max(own);
                Method::Network(networks)
            }
            Completion::Shell => Method::Shell,
            Completion::None => Method::None,
        };
        check_depths(octree_depth, options.full_depth)?;
        if let Some(prior) = &options.panorama {
            prior.check()?;
            if matches!(method, Method::None) {
                return Err(EstimateError::PanoramaWithoutRoom);
            }
        }
        Ok((method, octree_depth))
    }
}

/// Predicts expected light around the camera; `None` if the networks were not trained for it.
fn expected_light(networks: &Networks, working: &Frame, up: Vec3) -> Option<ExpectedLight> {
    let predicted = networks.expected_light(&working.radiance(), &working.depth_m, &working.camera, up)?;
    Some(ExpectedLight::new(&predicted.radiance, predicted.camera_from_level, predicted.contrast_stops))
}

/// A completion method with the networks that it needs.
#[derive(Clone, Copy)]
enum Method<'a> {
    Network(&'a Networks),
    Shell,
    None,
}

impl From<Method<'_>> for Completion {
    fn from(method: Method<'_>) -> Self {
        match method {
            Method::Network(_) => Self::Network,
            Method::Shell => Self::Shell,
            Method::None => Self::None,
        }
    }
}
