use std::sync::Arc;

use crate::origin::PublicOrigin;
use crate::session_actor::SessionHandle;
use crate::{MakeEstimator, Sample};

/// State shared by the request handlers.
#[derive(Clone)]
pub(crate) struct App {
    pub session: Arc<SessionHandle>,
    pub token: Arc<str>,
    pub public_origin: Option<Arc<PublicOrigin>>,
    pub estimator: Option<MakeEstimator>,
    pub samples: Arc<[Sample]>,
}
