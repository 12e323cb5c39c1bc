//! Datasets that others publish, and folders of panoramas.

mod crop;
mod files;
mod futurehouse;
mod interiornet;
mod laval;
mod panoramas;

pub use crop::CropModel;
pub use futurehouse::FutureHouse;
pub use interiornet::InteriorNet;
pub use laval::LavalVarying;
pub use panoramas::Panoramas;
