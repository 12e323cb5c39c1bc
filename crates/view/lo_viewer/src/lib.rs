//! An editing session as a page in a browser: `lightoctree view`.
//!
//! [`run`] serves the page and a WebSocket to this machine only, unless [`Options::bind`] says otherwise. Everyone who
//! knows the address with its random token has full access; all other requests are refused, including those of other
//! sites' pages and under other host names. No file of the disk is served except recent rooms, which are also the only
//! files written: the page is embedded in the program, and downloads are made in memory.
//!
//! [`protocol`] defines the messages between page and server.

mod app;
mod autosave;
mod body;
mod connections;
mod download;
mod failure;
mod guard;
mod opening;
mod origin;
mod outbox;
mod outside;
mod overlays;
mod page;
mod page_queue;
mod page_socket;
pub mod protocol;
mod query;
mod random_hex;
mod recent;
mod reopen;
mod sample;
mod sequence;
mod sequence_download;
mod server;
mod session_actor;
mod stall_guard;
mod upload;
mod uploads;
mod warning_text;
mod worker;
mod zip_archive;

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

#[cfg(feature = "depth-models")]
pub use opening::ReadDepthModel;
pub use opening::{MakeEstimator, NamedFile, PhotoSource, SceneSource};
pub use origin::PublicOrigin;
pub use sample::Sample;
pub use server::run;
pub use warning_text::WarningText;

/// Options of the server.
pub struct Options {
    /// Address to listen on.
    pub bind: IpAddr,
    /// Port; 0 chooses a free one.
    pub port: u16,
    /// Token in the address; `None` generates a random one.
    pub token: Option<String>,
    /// Formats warnings for the page.
    pub warning_text: WarningText,
    /// Address of a proxy through which browsers reach the page.
    pub public_origin: Option<PublicOrigin>,
    /// Creates the estimator for photos; without one, only scenes can be opened.
    pub estimator: Option<MakeEstimator>,
    /// Opened at the start.
    pub source: Option<SceneSource>,
    /// Photos to try the program with.
    pub samples: Vec<Sample>,
    /// Folder in which open rooms are saved automatically; `None` saves nothing.
    pub recent: Option<PathBuf>,
}

impl Options {
    /// Address for access from this machine only.
    pub const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
}

/// The server could not be started.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The address cannot be bound.
    #[error("cannot listen on {address}: {source}")]
    Bind {
        /// Address and port.
        address: String,
        /// The cause.
        source: std::io::Error,
    },
    /// The system failed to provide random numbers, threads or timers.
    #[error("cannot start the server: {0}")]
    Start(#[from] std::io::Error),
}
