//! Readers of published datasets, folders of panoramas, and photos with measured depth.

mod crop;
mod files;
mod frames;
mod futurehouse;
mod hdf5;
mod hypersim;
mod interiornet;
mod interiorverse;
mod laval;
mod lighthouse;
mod npz;
mod panorama_depth;
mod panoramas;
mod room_plan;
mod splits;

pub use crop::CropModel;
pub use frames::Frames;
pub use futurehouse::FutureHouse;
pub use hypersim::Hypersim;
pub use interiornet::InteriorNet;
pub use interiorverse::InteriorVerse;
pub use laval::LavalVarying;
pub use lighthouse::Lighthouse;
pub use panoramas::Panoramas;
pub use room_plan::RoomPlan;
