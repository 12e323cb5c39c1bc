//! A session at a scene as a page in a browser: `lightoctree view`.
//!
//! [`run`] serves the page and a WebSocket on this machine alone, unless told otherwise ([`Options::bind`]). Whoever knows the address with its random
//! token may do everything that the page can; nobody else gets an answer. Requests of other sites' pages and under other names are refused. No path of
//! the disk is served: the page is part of the program, and what it shows and takes away comes out of memory.
//!
//! [`protocol`] is what page and server say to each other.

mod app;
mod download;
mod failure;
mod film;
mod guard;
mod opening;
mod origin;
mod outbox;
mod outside;
mod page;
mod pool;
pub mod protocol;
mod sequence;
mod server;
mod session_actor;
mod upload;
mod worker;

use std::borrow::Cow;
use std::net::{IpAddr, Ipv4Addr};

use lightoctree::{Stage, Warning};

#[cfg(feature = "depth-models")]
pub use opening::ReadDepthModel;
pub use opening::{MakeEstimator, NamedFile, PhotoSource, Source};
pub use origin::PublicOrigin;
pub use server::run;

/// Formats what the library reports.
#[derive(Clone, Copy)]
pub struct EventText {
    /// A stage's name.
    pub stage: fn(&Stage) -> Cow<'static, str>,
    /// A warning as a sentence, given the names of the objects.
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
    /// The text of stages and warnings.
    pub text: EventText,
    /// The address of a proxy through which browsers reach the page.
    pub public_origin: Option<PublicOrigin>,
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
