use std::path::Path;

use lo_events::OnEvent;
use lo_geometry::Vec3;
use lo_nets::Networks;
use lo_nets::checkpoint::CheckpointError;
use lo_octree::check_depths;
use lo_scene::{Completion, Estimate, EstimateOrigin, ExpectedLight, Frame};

use crate::completed::{Completed, by_network, closed, observed_only};
use crate::panorama::laid;
use crate::view::View;
use crate::{DEFAULT_OCTREE_DEPTH, EstimateError, EstimateOptions, Input};

/// From photos, with depth or without, to scenes.
#[derive(Debug)]
pub struct Estimator {
    networks: Option<Networks>,
}

impl Estimator {
    /// With the trained networks that this library carries (feature `weights`).
    ///
    /// # Errors
    /// None, unless the library itself is damaged.
    #[cfg(feature = "weights")]
    pub fn shipped() -> Result<Self, CheckpointError> {
        crate::weights::shipped_networks().map(Self::new)
    }

    /// With the networks of a file of weights.
    ///
    /// # Errors
    /// A file that cannot be read or holds no such networks.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        Networks::read(path).map(Self::new)
    }

    /// With these networks.
    pub fn new(networks: Networks) -> Self {
        Self { networks: Some(networks) }
    }

    /// Without networks: rooms are closed by planes, and photos need depth.
    pub const fn without_networks() -> Self {
        Self { networks: None }
    }

    /// Its networks.
    pub fn networks(&self) -> Option<&Networks> {
        self.networks.as_ref()
    }

    /// From a photo, with depth or without, to a self-contained scene (`docs/method.md`).
    ///
    /// The same input, options and weights give the same scene to the bit, on any number of threads. What the photo shows unclipped is in the scene as it
    /// was seen.
    ///
    /// # Errors
    /// No usable depth, impossible octree depths, networks that are needed and not there, networks whose output is not finite;
    /// [`Cancelled`](lo_events::Cancelled) where `on_event` breaks off, between two steps.
    pub fn estimate(
        &self,
        input: Input,
        options: &EstimateOptions,
        on_event: OnEvent<'_>,
    ) -> Result<Estimate, EstimateError> {
        let (completion, octree_depth) = self.plan(options)?;
        let mut view = View::new(input, self.networks(), on_event)?;
        let prior = options.panorama.as_ref();
        let told = match completion {
            How::Network(_) | How::Shell if options.up.is_none() => view.up(self.networks(), on_event)?,
            _ => None,
        };
        let options = &EstimateOptions {
            up: options.up.or(told.map(|(up, _)| up)),
            sources: options.sources.clone(),
            panorama: None,
            ..*options
        };
        let mut completed = match completion {
            How::Network(networks) => by_network(&view, networks, octree_depth, options, on_event)?,
            How::Shell => closed(&view, octree_depth, options, on_event)?,
            How::None => observed_only(&view, octree_depth, options, on_event)?,
        };
        let panorama = prior.map(|prior| laid(&mut completed, prior, &view.working, on_event)).transpose()?;
        let up = completed.room.as_ref().map(|room| room.up);
        let expected = match (&completion, up) {
            (How::Network(networks), Some(up)) => expected_light(networks, &view.working, up),
            _ => None,
        };
        let Completed { light, room, confidence } = completed;
        let (other_photos, View { frame, predicted_depth, model: depth_model, .. }) = (view.other_photos(), view);
        let (completion, sources) = (completion.into(), options.sources.clone());
        let origin = EstimateOrigin {
            completion,
            camera_source: options.camera_source,
            up_deviation_deg: told.and_then(|(_, deviation_deg)| deviation_deg).map(|deg| deg as f32),
            sources,
            predicted_depth,
            depth_model,
        };
        let observed = Estimate::observed_only(light, frame);
        Ok(Estimate { room, confidence, expected, panorama, other_photos, origin, ..observed })
    }

    /// How, and down to which depth: the options are checked before any work, since the shell's closing points grow with 4^depth.
    fn plan(&self, options: &EstimateOptions) -> Result<(How<'_>, u32), EstimateError> {
        let mut octree_depth = options.octree_depth.unwrap_or(DEFAULT_OCTREE_DEPTH);
        let usual = if self.networks.is_some() { Completion::Network } else { Completion::Shell };
        let how = match options.completion.unwrap_or(usual) {
            Completion::Network => {
                let networks = self.networks().ok_or(EstimateError::NoNetworks("completion by a network"))?;
                let own = networks.config.depth;
                if let Some(asked) = options.octree_depth.filter(|&asked| asked < own) {
                    return Err(EstimateError::OctreeDepth { asked, own });
                }
                octree_depth = octree_depth.max(own);
                How::Network(networks)
            }
            Completion::Shell => How::Shell,
            Completion::None => How::None,
        };
        check_depths(octree_depth, options.full_depth)?;
        if let Some(prior) = &options.panorama {
            prior.check()?;
            if matches!(how, How::None) {
                return Err(EstimateError::PanoramaWithoutRoom);
            }
        }
        Ok((how, octree_depth))
    }
}

/// The energy of the light around the camera, as far as these networks tell it.
fn expected_light(networks: &Networks, seen: &Frame, up: Vec3) -> Option<ExpectedLight> {
    let guess = networks.expected_light(&seen.radiance(), &seen.depth_m, &seen.camera, up)?;
    Some(ExpectedLight::new(&guess.radiance, guess.camera_from_level, guess.contrast_stops))
}

/// How the room is completed, with what that needs.
#[derive(Clone, Copy)]
enum How<'a> {
    Network(&'a Networks),
    Shell,
    None,
}

impl From<How<'_>> for Completion {
    fn from(how: How<'_>) -> Self {
        match how {
            How::Network(_) => Self::Network,
            How::Shell => Self::Shell,
            How::None => Self::None,
        }
    }
}
