//! What is done with files of weights as a whole, between training and shipping.

use std::io;
use std::path::{Path, PathBuf};

use lo_nets::checkpoint::{Checkpoint, CheckpointError, Precision};
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;
use lo_nets::{DEPTH_NET, Device, LIGHT_NET, Networks};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Why files of weights cannot be made one, or not be read.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// A file that cannot be read or written, or whose networks are not whole.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The system refused to give its bytes.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A tensor that one file has and another has not.
    #[error("{} has no tensor \"{tensor}\", which {} has", path.display(), other.display())]
    Missing {
        /// Its name.
        tensor: String,
        /// The file without it.
        path: PathBuf,
        /// The file with it.
        other: PathBuf,
    },
    /// A tensor that is not of one shape in all files.
    #[error("tensor \"{tensor}\" is {shape:?} in {}, but {other_shape:?} in {}", path.display(), other.display())]
    Shape {
        /// Its name.
        tensor: String,
        /// A file.
        path: PathBuf,
        /// Its shape there.
        shape: Vec<usize>,
        /// Another file.
        other: PathBuf,
        /// Its shape there.
        other_shape: Vec<usize>,
    },
    /// Light networks of other configurations.
    #[error("the light network of {} is configured otherwise than that of {}", path.display(), other.display())]
    Config {
        /// A file.
        path: PathBuf,
        /// Another file.
        other: PathBuf,
    },
}

/// Writes the mean of the networks of `files`, weight by weight, in 16 bits. Checkpoints of runs count with their averaged weights.
///
/// # Errors
/// Files that cannot be read, or whose networks differ: names the first tensor.
///
/// # Panics
/// Without files.
pub fn average(files: &[PathBuf], to: &Path) -> Result<(), WeightsError> {
    let checkpoints: Vec<Checkpoint> = files.iter().map(Checkpoint::read).collect::<Result<_, _>>()?;
    let (first, others) = checkpoints.split_first().expect("a file at least");
    for (checkpoint, path) in others.iter().zip(&files[1..]) {
        same_networks((first, &files[0]), (checkpoint, path))?;
        if checkpoint.state[LIGHT_NET] != first.state[LIGHT_NET] {
            return Err(WeightsError::Config { path: path.clone(), other: files[0].clone() });
        }
    }
    let mut mean = Checkpoint::default();
    for (name, shape) in networks_of(first) {
        // −0 is what a sum begins with: 0 would make zeros lose their sign
        let mut sums = vec![-0.0f64; shape.iter().product()];
        for values in checkpoints.iter().filter_map(|checkpoint| checkpoint.values(name)) {
            sums.iter_mut().zip(values).for_each(|(sum, &value)| *sum += f64::from(value));
        }
        let count = checkpoints.len() as f64;
        mean.insert(name, shape, sums.into_iter().map(|sum| (sum / count) as f32).collect());
    }
    mean.state[DEPTH_NET] = first.state[DEPTH_NET].clone();
    mean.state[LIGHT_NET] = first.state[LIGHT_NET].clone();
    write(mean, to)
}

/// Writes the depth network of one file and the light network of another as one file of weights, in 16 bits.
///
/// # Errors
/// Files that cannot be read, and networks whose global lighting features differ in length: names the tensor.
pub fn merge(depth: &Path, light: &Path, to: &Path) -> Result<(), WeightsError> {
    let (from_depth, from_light) = (Checkpoint::read(depth)?, Checkpoint::read(light)?);
    let mut merged = Checkpoint::default();
    for (from, network) in [(&from_depth, DEPTH_NET), (&from_light, LIGHT_NET)] {
        for (name, shape) in networks_of(from).filter(|(name, _)| is_of(name, network)) {
            merged.insert(name, shape, from.values(name).unwrap_or_default().to_vec());
        }
    }
    merged.state[DEPTH_NET] = from_depth.state[DEPTH_NET].clone();
    merged.state[LIGHT_NET] = from_light.state[LIGHT_NET].clone();
    write(merged, to)
}

/// What a file of weights is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
    /// Weights of the depth network.
    pub depth_net_values: u64,
    /// Weights of the light network.
    pub light_net_values: u64,
    /// What of the depth network looks at the photo.
    pub encoder: EncoderKind,
    /// The light network's shape.
    pub light_net: LightNetConfig,
}

/// Looks at a file of weights or at a run's checkpoint.
///
/// # Errors
/// Files that cannot be read, or do not hold both networks whole.
pub fn inspect(path: &Path) -> Result<Inspection, WeightsError> {
    let bytes = std::fs::read(path).map_err(|source| WeightsError::Io { path: path.to_owned(), source })?;
    let checkpoint = Checkpoint::from_bytes(&bytes, &path.display().to_string())?;
    let [depth_net_values, light_net_values] = [DEPTH_NET, LIGHT_NET].map(|network| checkpoint.values_of(network));
    let networks = Networks::from_checkpoint(checkpoint, &Device::flex())?;
    Ok(Inspection {
        sha256: Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect(),
        bytes: bytes.len() as u64,
        depth_net_values,
        light_net_values,
        encoder: networks.depth.encoder_kind(),
        light_net: networks.config,
    })
}

fn is_of(tensor: &str, network: &str) -> bool {
    tensor.strip_prefix(network).is_some_and(|rest| rest.starts_with('.'))
}

/// Names and shapes of the tensors that are used, without those that only training needs.
fn networks_of(checkpoint: &Checkpoint) -> impl Iterator<Item = (&str, &[usize])> {
    checkpoint.shapes().filter(|(name, _)| is_of(name, DEPTH_NET) || is_of(name, LIGHT_NET))
}

fn same_networks((a, path): (&Checkpoint, &Path), (b, other): (&Checkpoint, &Path)) -> Result<(), WeightsError> {
    let lacks = |tensor: &str, path: &Path, other: &Path| WeightsError::Missing {
        tensor: tensor.to_owned(),
        path: path.to_owned(),
        other: other.to_owned(),
    };
    for (name, shape) in networks_of(a) {
        let (_, other_shape) = networks_of(b).find(|(own, _)| *own == name).ok_or_else(|| lacks(name, other, path))?;
        if shape != other_shape {
            return Err(WeightsError::Shape {
                tensor: name.to_owned(),
                path: path.to_owned(),
                shape: shape.to_vec(),
                other: other.to_owned(),
                other_shape: other_shape.to_vec(),
            });
        }
    }
    match networks_of(b).find(|(name, _)| !a.has(name)) {
        Some((name, _)) => Err(lacks(name, path, other)),
        None => Ok(()),
    }
}

/// Writes networks that are whole.
fn write(checkpoint: Checkpoint, to: &Path) -> Result<(), WeightsError> {
    Ok(Networks::from_checkpoint(checkpoint, &Device::flex())?.write(to, Precision::Half)?)
}
