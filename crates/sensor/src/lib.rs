//! Camera and depth-sensor models: from radiance and true depth to what a device records.
