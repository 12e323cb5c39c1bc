//! Messages of warnings, with hints at options of the command line.

use lightoctree::Warning;
use lightoctree::events::{EstimateWarning, InsertWarning, PanoramaWarning};
use lightoctree::footage::ShotWarning;

/// Returns the message of a warning. `objects` are the names of the inserted objects, used if there are several.
pub fn warning_text(warning: &dyn Warning, objects: &[String]) -> String {
    let mut text = match warning.downcast_ref::<InsertWarning>() {
        Some(warning) => warning.with_names(objects).to_string(),
        None => warning.to_string(),
    };
    text.extend(hint(warning));
    text
}

/// Returns what to do about a warning by options, as the end of its sentence.
fn hint(warning: &dyn Warning) -> Option<String> {
    match warning.downcast_ref() {
        Some(EstimateWarning::AssumedExposures { photos }) => {
            let them = if photos.len() == 1 { "it" } else { "them" };
            return Some(format!("; set {them} with --exposures"));
        }
        Some(EstimateWarning::WidePhoto { .. }) => return Some("; --hfov-deg sets its field of view".to_owned()),
        Some(EstimateWarning::InverseDepth { .. }) => return Some(": --depth-is inverse".to_owned()),
        _ => {}
    }
    if let Some(warning) = warning.downcast_ref() {
        return insert_hint(warning);
    }
    if let Some(warning) = warning.downcast_ref() {
        return Some(match warning {
            ShotWarning::ScaleUnknown => "; --track-scale sets it".to_owned(),
            ShotWarning::OtherLens { .. } => "; estimate it again with --intrinsics FILE of the track".to_owned(),
        });
    }
    match warning.downcast_ref()? {
        PanoramaWarning::PoorMatch { yaw_deg, .. } => Some(format!(
            ": check that it shows this room and was taken at --panorama-at. It is used with a yaw of {yaw_deg:.0}°; \
             --panorama-yaw-deg sets another"
        )),
        PanoramaWarning::NotCompared => {
            Some(": set --panorama-yaw-deg and --panorama-exposure-ev if you know them".to_owned())
        }
        _ => None,
    }
}

fn insert_hint(warning: &InsertWarning) -> Option<String> {
    match warning {
        InsertWarning::ObjectTooHigh { likely: Some(unit), .. }
        | InsertWarning::ObjectTooWide { likely: Some(unit), .. } => {
            Some(format!(": {}? Set the unit of its file with --unit {}", unit.name(), unit.symbol()))
        }
        InsertWarning::ObjectTooHigh { likely: None, .. }
        | InsertWarning::ObjectTooWide { likely: None, .. }
        | InsertWarning::ObjectTooSmall { .. } => Some(": set its size with --height METRES".to_owned()),
        InsertWarning::ObjectTransparent { .. } => Some("; --material gives it another one".to_owned()),
        InsertWarning::ObjectFloats { .. } | InsertWarning::ObjectSunk { .. } => {
            Some("; --pixel places it on a surface of the photo".to_owned())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use lightoctree::events::CompletionWarning;
    use lightoctree::insert::Unit;

    use super::*;

    #[test]
    fn hints_name_options() {
        let assumed = |photos: &[usize]| {
            let warning = EstimateWarning::AssumedExposures { photos: photos.to_vec() };
            warning_text(&warning, &[])
        };
        assert_eq!(
            assumed(&[1]),
            "photo 2 overlaps none of the photos before it, so its exposure is estimated from its brightness; set it \
             with --exposures"
        );
        assert!(assumed(&[1, 2]).ends_with("their brightness; set them with --exposures"), "{}", assumed(&[1, 2]));
        let panorama = PanoramaWarning::PoorMatch { confidence: 0.25, least: 0.4, yaw_deg: -30.0 };
        assert_eq!(
            warning_text(&panorama, &[]),
            "the panorama matches the photo poorly (confidence 0.25, expected at least 0.40): check that it shows this \
             room and was taken at --panorama-at. It is used with a yaw of -30°; --panorama-yaw-deg sets another"
        );
        assert_eq!(
            warning_text(&PanoramaWarning::NotCompared, &[]),
            "the panorama's position sees too little of what the photo shows, so its yaw is uncertain: set \
             --panorama-yaw-deg and --panorama-exposure-ev if you know them"
        );
    }

    #[test]
    fn sizes_suggest_the_unit() {
        let high = |likely| {
            let warning = InsertWarning::ObjectTooHigh { object: 0, height_m: 30.0, room_m: 2.61, likely };
            warning_text(&warning, &[])
        };
        assert_eq!(
            high(Some(Unit::Centimetre)),
            "the object is 30 m high, higher than the room (2.6 m): centimetres? Set the unit of its file with --unit cm"
        );
        assert_eq!(
            high(None),
            "the object is 30 m high, higher than the room (2.6 m): set its size with --height METRES"
        );
    }

    #[test]
    fn other_warnings_have_their_own_message() {
        let lamp = CompletionWarning::AssumedLamp { radiance: 2.0 };
        assert_eq!(warning_text(&lamp, &[]), lamp.to_string());
        let names = ["table", "vase"].map(str::to_owned);
        let intersect = InsertWarning::ObjectsIntersect { objects: [0, 1] };
        assert_eq!(warning_text(&intersect, &names), "table and vase intersect: move one of them");
    }
}
