use std::path::PathBuf;

use lo_geometry::Vec3;

use super::photo_list::PhotoListArgs;
#[cfg(feature = "depth-models")]
use crate::commands::depth_model::DepthModelArgs;
use crate::commands::environment::EnvironmentArgs;
use crate::commands::estimate::MethodArgs;
use crate::commands::lens::LensArgs;
use crate::commands::parse;

/// Name of the command.
pub const COMMAND: &str = "batch";

/// Options of `batch`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree batch photos -o scenes\n  \
    lightoctree batch photos --envmap-at 0,0,-1 --level --no-scenes -o light\n  \
    lightoctree batch --list photos.txt --root /data/photos -o scenes\n  \
    lightoctree batch photos --shard $((SLURM_ARRAY_TASK_ID + 1))/16 -o scenes\n\n\
    The photo kitchen/a.jpg of a folder becomes kitchen/a.jpg.scene of the output folder, and kitchen/a.jpg.exr with \
    --envmap-at. To resume a stopped run, to add photos, or to try failed ones again, run the same command again: \
    finished results are kept. Results are those of `estimate` and `envmap`, whatever --shard and --threads are. \
    The exit code is 1 if photos failed. docs/cluster.md describes the files and jobs of Slurm.")]
pub struct Args {
    #[command(flatten)]
    pub(super) photos: PhotoListArgs,

    /// Process only part I of N, counted from 1: every N-th photo; for several machines or cluster jobs
    #[arg(long, value_name = "I/N", default_value = "1/1", value_parser = parse::part)]
    pub(super) shard: [u32; 2],

    #[cfg(feature = "depth-models")]
    #[command(flatten)]
    pub(super) depth_model: DepthModelArgs,

    #[command(flatten)]
    pub(super) lens: LensArgs,

    #[command(flatten)]
    pub(super) method: MethodArgs,

    /// Also write an HDR environment map at this position, in metres in each camera's frame: +X right, +Y up, the
    /// camera at 0,0,0 looks along -Z
    ///
    /// The options below are those of `envmap`. The report gets spherical harmonics and the main light.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    pub(super) envmap_at: Option<Vec3>,

    #[command(flatten)]
    pub(super) panorama: EnvironmentArgs,

    /// Write environment maps only; scenes contain the uncompressed photo
    #[arg(long, requires = "envmap_at")]
    pub(super) no_scenes: bool,

    /// Output folder
    #[arg(long, short, value_name = "DIR")]
    pub(super) output: PathBuf,

    /// Write into a folder with other contents
    #[arg(long)]
    pub(super) force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    pub(super) json: bool,
}
