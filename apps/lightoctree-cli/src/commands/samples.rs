//! Sample rooms of the viewer.

use lo_viewer::Sample;

use super::demo;

/// The rooms, in the order of the page.
pub const SAMPLES: [Sample; 3] = [
    Sample {
        title: "Library shelf",
        photo: ("library.jpg", demo::PHOTO),
        depth: Some(("library_depth.png", demo::DEPTH)),
        intrinsics: Some(demo::INTRINSICS),
    },
    Sample {
        title: "Office desk",
        photo: ("office.jpg", include_bytes!("../../assets/office_desk.jpg")),
        depth: Some(("office_depth.png", include_bytes!("../../assets/office_desk_depth.png"))),
        // The Kinect's, as the benchmark's tools use them.
        intrinsics: Some([525.0, 525.0, 319.5, 239.5]),
    },
    Sample {
        title: "Table",
        photo: ("table.jpg", include_bytes!("../../assets/table.jpg")),
        depth: None,
        intrinsics: None,
    },
];
