use lo_geometry::Vec3;
use lo_imaging::{DepthMap, RadianceImage};
use lo_nets::checkpoint::Checkpoint;

use crate::BaselineError;
use crate::features::PhotoFeatures;
use crate::planes::Planes;

/// Width and height of the true panorama at the camera.
pub const PANORAMA: [usize; 2] = [128, 64];

/// Width and height of the true panorama of a probe.
pub const PROBE_MAP: [usize; 2] = [32, 16];

/// True light at a point in front of a seen surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Row and column of the cell that shows the surface.
    pub cell: [usize; 2],
    /// Position in the photo's frame, metres.
    pub position_m: Vec3,
    /// Radiance in the photo's frame, of size [`PROBE_MAP`], in units of the photo's white.
    pub radiance: RadianceImage,
    /// Distance to the surfaces around the point, of the same size; 0 where unknown.
    pub distance_m: DepthMap,
}

/// Training example of one photo.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineExample {
    /// Features of the photo.
    pub features: PhotoFeatures,
    /// True panorama at the camera, of size [`PANORAMA`], in the photo's frame.
    pub panorama: RadianceImage,
    /// True base colour of the cells, `[3, rows, columns]`; 0 where unknown.
    pub albedo: Planes,
    /// True unit normals of the cells in the photo's frame, `[3, rows, columns]`; 0 where unknown.
    pub normal: Planes,
    /// True light at points in front of surfaces.
    pub probes: Vec<Probe>,
}

impl BaselineExample {
    /// Converts to the content of a file.
    pub fn to_checkpoint(&self) -> Checkpoint {
        let mut file = Checkpoint::default();
        let features = &self.features;
        for (name, planes) in [
            ("eighth", &features.eighth),
            ("sixteenth", &features.sixteenth),
            ("last", &features.last),
            ("photo", &features.photo),
            ("points", &features.points_m),
            ("albedo", &self.albedo),
            ("normal", &self.normal),
        ] {
            planes.add_to(&mut file, name);
        }
        file.insert("global", &[features.global.len()], features.global.clone());
        file.insert("shown", &[2], features.shown.map(|count| count as f32).into());
        let flat = |images: &[&RadianceImage]| -> Vec<f32> {
            images.iter().flat_map(|image| image.pixels().iter().flatten().copied()).collect()
        };
        let ([width, height], count) = (PROBE_MAP, self.probes.len());
        file.insert("panorama", &[PANORAMA[1], PANORAMA[0], 3], flat(&[&self.panorama]));
        let radiance: Vec<&RadianceImage> = self.probes.iter().map(|probe| &probe.radiance).collect();
        file.insert("probes", &[count, height, width, 3], flat(&radiance));
        let cells = self.probes.iter().flat_map(|probe| probe.cell.map(|at| at as f32)).collect();
        file.insert("cells", &[count, 2], cells);
        let positions = self.probes.iter().flat_map(|probe| probe.position_m.to_array()).collect();
        file.insert("positions", &[count, 3], positions);
        let distances = self.probes.iter().flat_map(|probe| probe.distance_m.pixels().iter().copied()).collect();
        file.insert("distances", &[count, height, width], distances);
        file
    }

    /// Reads what [`to_checkpoint`](Self::to_checkpoint) has made.
    ///
    /// # Errors
    /// Missing or wrong tensors.
    pub fn from_checkpoint(file: &Checkpoint) -> Result<Self, BaselineError> {
        let wrong = |what| BaselineError::Example { what };
        let planes = |name| Planes::read(file, name).ok_or(wrong(name));
        let values = |name| file.values(name).ok_or(wrong(name));
        let image = |values: &[f32], [width, height]: [usize; 2], what| {
            let pixels = values.as_chunks::<3>().0;
            if pixels.len() != width * height {
                return Err(wrong(what));
            }
            Ok(RadianceImage::new(width, height, pixels.to_vec()))
        };
        let &[rows, columns] = values("shown")? else { return Err(wrong("shown")) };
        let features = PhotoFeatures {
            eighth: planes("eighth")?,
            sixteenth: planes("sixteenth")?,
            last: planes("last")?,
            photo: planes("photo")?,
            points_m: planes("points")?,
            global: values("global")?.to_vec(),
            shown: [rows as usize, columns as usize],
        };
        let [width, height] = PROBE_MAP;
        let area = width * height;
        let cells = values("cells")?.as_chunks::<2>().0;
        let (radiance, distances) = (values("probes")?, values("distances")?);
        let positions = values("positions")?.as_chunks::<3>().0;
        let counts = [radiance.len() / 3 / area, distances.len() / area, positions.len()];
        if counts != [cells.len(); 3] {
            return Err(wrong("probes"));
        }
        let probe = |i: usize| -> Result<Probe, BaselineError> {
            Ok(Probe {
                cell: cells[i].map(|at| at as usize),
                position_m: positions[i].into(),
                radiance: image(&radiance[3 * area * i..][..3 * area], PROBE_MAP, "probes")?,
                distance_m: DepthMap::new(width, height, distances[area * i..][..area].to_vec()),
            })
        };
        let probes = (0..cells.len()).map(probe);
        Ok(Self {
            features,
            panorama: image(values("panorama")?, PANORAMA, "panorama")?,
            albedo: planes("albedo")?,
            normal: planes("normal")?,
            probes: probes.collect::<Result<_, _>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::testing;

    #[test]
    fn files_give_back_what_was_written() {
        let example = testing::example(3);
        let file = example.to_checkpoint();
        assert_eq!(BaselineExample::from_checkpoint(&file).unwrap(), example);
        let mut other = file.clone();
        other.insert("probes", &[1], vec![0.0]);
        let error = BaselineExample::from_checkpoint(&other).unwrap_err().to_string();
        assert!(error.contains("\"probes\""), "{error}");
        let error = BaselineExample::from_checkpoint(&Checkpoint::default()).unwrap_err().to_string();
        assert!(error.contains("\"shown\""), "{error}");
    }
}
