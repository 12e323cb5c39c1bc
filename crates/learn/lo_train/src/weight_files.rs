//! Averages, merges, splits, joins and inspects weights files.

use std::io;
use std::path::{Path, PathBuf};

use lo_nets::checkpoint::{Checkpoint, CheckpointError, Precision};
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;
use lo_nets::{DEPTH_NET, Device, EXPECTED_NET, LIGHT_NET, Networks};
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Errors of operations on weights files.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// A file cannot be read or written, or its networks are incomplete.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A tensor is missing in one of the files.
    #[error("{} has no tensor \"{tensor}\", which {} has", path.display(), other.display())]
    Missing {
        /// Name of the tensor.
        tensor: String,
        /// The file without the tensor.
        path: PathBuf,
        /// The file with the tensor.
        other: PathBuf,
    },
    /// A tensor has different shapes in two files.
    #[error("tensor \"{tensor}\" is {shape:?} in {}, but {other_shape:?} in {}", path.display(), other.display())]
    Shape {
        /// Name of the tensor.
        tensor: String,
        /// One of the files.
        path: PathBuf,
        /// Shape of the tensor in that file.
        shape: Vec<usize>,
        /// The other file.
        other: PathBuf,
        /// Shape of the tensor in that file.
        other_shape: Vec<usize>,
    },
    /// The light networks of two files have different configurations.
    #[error("the light networks of {} and {} have different configurations", path.display(), other.display())]
    Config {
        /// One of the files.
        path: PathBuf,
        /// The other file.
        other: PathBuf,
    },
}

/// Writes the mean of the networks of `files`, weight by weight, in 16 bits.
///
/// Of a run's checkpoint, the averaged weights are used.
///
/// # Errors
/// Unreadable files; networks of different shapes (names the first tensor).
///
/// # Panics
/// If `files` is empty.
pub fn average(files: &[PathBuf], to: &Path) -> Result<(), WeightsError> {
    let checkpoints: Vec<Checkpoint> = files.iter().map(Checkpoint::read).collect::<Result<_, _>>()?;
    let (first, others) = checkpoints.split_first().expect("at least one file");
    for (checkpoint, path) in others.iter().zip(&files[1..]) {
        same_networks((first, &files[0]), (checkpoint, path))?;
        if checkpoint.state[LIGHT_NET] != first.state[LIGHT_NET] {
            return Err(WeightsError::Config { path: path.clone(), other: files[0].clone() });
        }
    }
    let mut mean = Checkpoint::default();
    for (name, shape) in networks_of(first) {
        // Starting at −0 preserves the sign of zeros.
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

/// Writes the depth network of one file and the light network of another as one weights file, in 16 bits.
///
/// The expected-light network is that of `light`, or of `depth` if `light` has none.
///
/// # Errors
/// Unreadable files; networks with global features of different lengths (names the tensor).
pub fn merge(depth: &Path, light: &Path, to: &Path) -> Result<(), WeightsError> {
    let (mut from_depth, mut from_light) = (Checkpoint::read(depth)?, Checkpoint::read(light)?);
    let has_expected = from_light.values_of(EXPECTED_NET) > 0;
    let expected = if has_expected { &mut from_light } else { &mut from_depth }.split_off(EXPECTED_NET);
    let mut merged = Checkpoint::joined([from_depth.split_off(DEPTH_NET), from_light.split_off(LIGHT_NET), expected])?;
    merged.state[DEPTH_NET] = from_depth.state[DEPTH_NET].clone();
    merged.state[LIGHT_NET] = from_light.state[LIGHT_NET].clone();
    write(merged, to)
}

/// Writes the networks of a file as the two files that ship, in 16 bits: the image encoder, and everything else.
///
/// Each of them is a crate of its own, because a registry accepts packages of at most 10 MB.
///
/// # Errors
/// Unreadable files; files without both networks complete.
pub fn split(file: &Path, encoder: &Path, heads: &Path) -> Result<(), WeightsError> {
    let mut all = Checkpoint::read(file)?;
    let mut networks = Checkpoint::joined([DEPTH_NET, LIGHT_NET, EXPECTED_NET].map(|network| all.split_off(network)))?;
    for network in [DEPTH_NET, LIGHT_NET] {
        networks.state[network] = all.state[network].take();
    }
    Networks::from_checkpoint(networks.clone(), &Device::flex())?;
    networks.split_off(&format!("{DEPTH_NET}.encoder")).write(encoder, Precision::Half)?;
    Ok(networks.write(heads, Precision::Half)?)
}

/// Writes the networks of which `parts` are the parts as one weights file, in 16 bits: the inverse of [`split`].
///
/// # Errors
/// Unreadable files; parts that overlap or are incomplete.
pub fn join(parts: &[PathBuf], to: &Path) -> Result<(), WeightsError> {
    let parts: Vec<Checkpoint> = parts.iter().map(Checkpoint::read).collect::<Result<_, _>>()?;
    let joined = Checkpoint::joined(parts)?;
    Networks::from_checkpoint(joined.clone(), &Device::flex())?;
    Ok(joined.write(to, Precision::Half)?)
}

/// Summary of a weights file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Size of the file.
    pub bytes: u64,
    /// Number of weights of the depth network.
    pub depth_net_values: u64,
    /// Number of weights of the light network.
    pub light_net_values: u64,
    /// Image encoder of the depth network.
    pub encoder: EncoderKind,
    /// Shape of the light network.
    pub light_net: LightNetConfig,
}

/// Inspects a weights file or a run's checkpoint.
///
/// # Errors
/// Unreadable files; files without both networks complete.
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

/// Returns whether a tensor belongs to a network.
fn is_of(tensor: &str, network: &str) -> bool {
    tensor.strip_prefix(network).is_some_and(|rest| rest.starts_with('.'))
}

/// Returns names and shapes of the networks' tensors, without training state.
fn networks_of(checkpoint: &Checkpoint) -> impl Iterator<Item = (&str, &[usize])> {
    checkpoint.shapes().filter(|(name, _)| [DEPTH_NET, LIGHT_NET, EXPECTED_NET].iter().any(|net| is_of(name, net)))
}

/// Checks that two checkpoints have the same tensors.
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

/// Checks that the networks are complete and writes them.
fn write(checkpoint: Checkpoint, to: &Path) -> Result<(), WeightsError> {
    Ok(Networks::from_checkpoint(checkpoint, &Device::flex())?.write(to, Precision::Half)?)
}
