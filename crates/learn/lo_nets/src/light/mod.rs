//! Light network (`docs/method.md` §5): from the octree of observed surfaces to that of the whole room's radiance.

mod channels;
mod config;
mod error;
mod free_space;
mod growth;
mod input;
mod lobes;
mod losses;
mod network;
mod output;
mod photo_view;
mod radiance;
mod rays;
mod refine;
mod visible_point;
mod warning;

pub use channels::{MAX_RADIANCE, NODE_FEATURES};
pub use config::LightNetConfig;
pub use error::{LightConfigError, LightError};
pub use free_space::FreeSpace;
pub use growth::Growth;
pub use input::{LightInput, ambient_light};
pub use losses::{LightLossConfig, LightLosses, RayLosses};
pub use network::{BlockStage, LightNet};
pub use output::{LevelOutput, LightOutput};
pub use photo_view::PhotoView;
pub use radiance::{NodeLight, ObservedLight};
pub use rays::Rays;
pub(crate) use refine::ObservedDetail;
pub use visible_point::VisiblePoint;
pub use warning::NetworkWarning;
