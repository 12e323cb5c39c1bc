use std::sync::{Arc, Mutex};

use crate::MakeEstimator;
use crate::origin::PublicOrigin;
use crate::pool::Pool;
use crate::session_actor::SessionHandle;

/// State shared by the handlers of requests.
#[derive(Clone)]
pub(crate) struct App {
    pub session: Arc<SessionHandle>,
    pub token: Arc<str>,
    pub public_origin: Option<Arc<PublicOrigin>>,
    pub estimator: Option<MakeEstimator>,
    /// Uploaded files that wait for the file that names them.
    pub pool: Arc<Mutex<Pool>>,
}
