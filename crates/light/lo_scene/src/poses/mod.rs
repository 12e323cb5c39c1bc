//! Pose files: the poses of several photos or of a shot's frames, as written by apps and other programs.
//!
//! All poses become transforms from a camera's axes (+X right, +Y up, looking along −Z) to one world, in metres. Only
//! COLMAP's unit is arbitrary ([`PoseFormat::has_unit`]). The format is detected from the content:
//!
//! | format | detected by | camera axes | matched with photos by |
//! | --- | --- | --- | --- |
//! | lightoctree | `photos` | `axes`: `opengl` (ours) or `opencv` | `file` |
//! | Record3D `metadata.json` | `poses` | ours | the number in the photo's name |
//! | 3D Scanner App `frame_….json` | `cameraPoseARFrame` | ours (ARKit) | order, one file each |
//! | Polycam `cameras/….json` | `t_00` | ours (ARKit) | order, one file each |
//! | NeRF `transforms.json` | `frames` | ours (OpenGL) | `file_path` |
//! | TUM trajectory | lines of eight numbers | OpenCV | time stamps in the photos' names, within 20 ms; else order |
//! | Nuke `.chan` | extension `.chan`, or lines of seven numbers | ours (OpenGL) | frame: last number in the name |
//! | COLMAP `images.txt` | lines of nine numbers and a name | OpenCV | file name |
//! | USD `.usda` | `#usda` | ours (OpenGL) | frame: last number in the name |
//!
//! [`PhotoPoses::read`] reads and matches. [`PhotoLens::read`] takes the lens of a single photo from such a file, or
//! from COLMAP's `cameras.txt`.

mod arkit;
mod chan;
mod colmap;
mod colmap_images;
mod error;
mod euler;
mod lens_file;
mod matching;
mod nerf;
mod own;
mod pose;
mod pose_file;
mod read;
mod record3d;
#[cfg(test)]
mod tests;
mod tum;
mod usd;
mod usda_text;
mod values;

pub use error::PoseError;
pub use lens_file::PhotoLens;
pub use matching::PhotoPoses;
pub use pose::{Lens, Pose};
pub use pose_file::{PoseFile, PoseFormat};
