//! A session at a scene as a page in a browser: `lightoctree view`.
//!
//! [`run`] serves the page and a WebSocket on this machine alone, unless told otherwise ([`Options::bind`]). Whoever knows the address with its random
//! token may do everything that the page can; nobody else gets an answer. Requests of other sites' pages and under other names are refused. No path of
//! the disk is served: the page is part of the program, and what it shows and takes away comes out of memory.
//!
//! [`protocol`] is what page and server say to each other.

mod desk;
mod download;
mod film;
mod guard;
mod opening;
mod outbox;
mod outside;
mod page;
pub mod protocol;
mod server;
mod upload;
mod work;

use std::borrow::Cow;
use std::net::{IpAddr, Ipv4Addr};

use lightoctree::{Stage, Warning};

#[cfg(feature = "depth-models")]
pub use opening::ReadDepthModel;
pub use opening::{MakeEstimator, NamedFile, PhotoSource, Source};
pub use server::run;

/// The command line's words for what the library says.
#[derive(Clone, Copy)]
pub struct Words {
    /// What a stage is called.
    pub stage: fn(&Stage) -> Cow<'static, str>,
    /// A warning in words, with the names of the objects.
    pub warning: fn(&Warning, &[String]) -> String,
}

/// How a page is served.
pub struct Options {
    /// The address to listen at.
    pub bind: IpAddr,
    /// The port; 0 for a free one.
    pub port: u16,
    /// The token in the address; a random one where none is given.
    pub token: Option<String>,
    /// The words of messages.
    pub words: Words,
    /// What estimates the scenes of photos; without it only scenes can be opened.
    pub estimator: Option<MakeEstimator>,
    /// What is opened first.
    pub source: Option<Source>,
}

impl Options {
    /// On this machine alone, at a free port.
    pub const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The address cannot be had.
    #[error("cannot listen at {address}: {source}")]
    Bind {
        /// Which.
        address: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The system has no random numbers, threads or timers.
    #[error("cannot start the server: {0}")]
    Start(#[from] std::io::Error),
}
