//! New objects: their names, first sizes and places.

use std::sync::Arc;

use lightoctree::BUILTIN_PREFIX;
use lo_insert::{Align, Placement};

use crate::first_size::{first_size, fitted};
use crate::free_place::{Footprint, beside};
use crate::snap::{before_wall, held, level_continues, standing};
use crate::{Mesh, Object, ObjectMaterial, ObjectPosition, Session, SessionError, State};

impl Session {
    /// Makes a new object at the surface seen at a pixel, or on a free one.
    ///
    /// # Errors
    /// If the pixel or the material is invalid.
    pub(crate) fn new_object(
        &mut self,
        state: &State,
        mesh: Arc<Mesh>,
        pixel: Option<[f64; 2]>,
        material: Option<ObjectMaterial>,
    ) -> Result<Object, SessionError> {
        let size = first_size(&mesh);
        let file = mesh.name().strip_prefix(BUILTIN_PREFIX).unwrap_or(mesh.name());
        let stem = file.rsplit(['/', '\\']).next().unwrap_or(file);
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        let new = Object {
            id: self.next_id,
            name: free_name(state, stem),
            mesh,
            position: ObjectPosition::Position([0.0, 0.0, -1.0]),
            size,
            yaw_deg: 0.0,
            path: None,
            align: Align::default(),
            material,
            is_hidden: false,
            is_locked: false,
            placement: Placement::at(self.scene.estimate(), Default::default(), Align::Gravity),
        };
        let time_s = state.time_s;
        // The size determines where there is room, and the distance whether the size fits into the photo.
        let new = self.at_free_place(state, new.placed(self.scene.ground(), time_s)?, pixel)?;
        let camera = &self.scene.estimate().frame.camera;
        let new = match fitted(&new.mesh, new.placement.scale, new.placement.position_m, camera) {
            Some(size) => {
                let smaller = Object { size, ..new }.placed(self.scene.ground(), time_s)?;
                self.at_free_place(state, smaller, pixel)?
            }
            None => new,
        };
        self.next_id += 1;
        Ok(new)
    }

    /// Makes a copy next to an object.
    ///
    /// # Errors
    /// Never for an object of the session.
    pub(crate) fn duplicate(&mut self, state: &State, of: &Object) -> Result<Object, SessionError> {
        // Without keyframes: with the same ones it would coincide with the original.
        let new = Object { id: self.next_id, name: free_name(state, &of.name), path: None, ..of.clone() };
        let new = self.beside_others(state, new.placed(self.scene.ground(), 0.0)?);
        self.next_id += 1;
        Ok(new)
    }

    /// Places a new object at the surface seen at a pixel, or on a free one, beside other objects.
    fn at_free_place(&self, state: &State, new: Object, pixel: Option<[f64; 2]>) -> Result<Object, SessionError> {
        let (scene, time_s) = (&self.scene, state.time_s);
        let camera = &scene.estimate().frame.camera;
        // Where the photo has no depth, such as in a window, nothing can be placed.
        let pixel = pixel.filter(|&[u, v]| !camera.contains(u, v) || scene.surfaces.at_pixel(u, v).is_some());
        let position = match pixel {
            None => self.free_position(state, &new),
            Some(pixel) if standing(scene, &new, pixel).is_some() => {
                ObjectPosition::Pixel(before_wall(scene, &new, pixel))
            }
            Some(pixel) => match held(scene, &new, pixel) {
                Some(base_m) => ObjectPosition::Position(base_m.to_array().map(f64::from)),
                None => ObjectPosition::Pixel(pixel),
            },
        };
        Ok(self.beside_others(state, Object { position, ..new }.placed(scene.ground(), time_s)?))
    }

    /// Moves a placed object off other objects, if there is a free position nearby.
    fn beside_others(&self, state: &State, object: Object) -> Object {
        let position = beside(&self.scene, &object, &state.objects);
        let moved =
            position.and_then(|position| Object { position, ..object.clone() }.placed(self.scene.ground(), 0.0).ok());
        moved.unwrap_or(object)
    }

    /// Finds a supporting surface in the lower half of the photo, away from other objects.
    fn free_position(&self, state: &State, new: &Object) -> ObjectPosition {
        /// Candidate positions, as shares of width and height.
        const COLUMNS: [f64; 7] = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8];
        const ROWS: [f64; 5] = [0.75, 0.82, 0.68, 0.9, 0.6];
        let camera = self.scene.estimate().frame.camera;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let taken: Vec<Footprint> = state.objects.iter().map(Footprint::of).collect();
        let stands = |pixel: [f64; 2]| {
            let placement = standing(&self.scene, new, pixel)?;
            level_continues(&self.scene, &placement, pixel).then_some((pixel, placement))
        };
        let candidates =
            ROWS.iter().flat_map(|v| COLUMNS.map(|u| [(u * width).floor() + 0.5, (v * height).floor() + 0.5]));
        let supported: Vec<_> = candidates.filter_map(stands).collect();
        let is_free = |(_, placement): &&([f64; 2], Placement)| {
            let own = Footprint::of(&Object { placement: *placement, ..new.clone() });
            !taken.iter().any(|other| own.overlaps(other))
        };
        let found = supported.iter().find(is_free).or_else(|| supported.first());
        found.map(|(pixel, _)| ObjectPosition::Pixel(*pixel)).unwrap_or_else(|| {
            let ahead = camera.unproject(0.5 * width, 0.7 * height, f64::from(0.6 * self.scene.max_depth_m));
            ObjectPosition::Position(ahead.to_array().map(f64::from))
        })
    }
}

/// Returns an unused name: the wanted one, or numbered if it is taken.
fn free_name(state: &State, wanted: &str) -> String {
    let wanted = if wanted.is_empty() { "object" } else { wanted };
    let stem = wanted.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches([' ', '_']);
    let stem = if stem.is_empty() { wanted } else { stem };
    let taken = |name: &str| state.objects.iter().any(|object| object.name == name);
    let numbered = (2..).map(|number| format!("{stem} {number}"));
    std::iter::once(wanted.to_owned()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}
